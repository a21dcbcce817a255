#include "crypto/age_parallel.h"

#include <algorithm>
#include <cerrno>
#include <condition_variable>
#include <exception>
#include <limits>
#include <mutex>
#include <thread>
#include <unistd.h>
#include <vector>

#include "base/error.h"
#include "base/write_behind.h"

namespace kiroku::crypto {
namespace {

// 512 KiB: small enough that ciphertext and plaintext stay in a core's second-level cache, large enough that
// handing runs out costs nothing.
constexpr std::uint64_t kChunksPerRun = 8;

std::uint64_t run_count(const AgePayload& payload) {
  return (payload.chunks + kChunksPerRun - 1) / kChunksPerRun;
}

std::uint64_t chunks_in_run(const AgePayload& payload, std::uint64_t run) {
  return std::min(kChunksPerRun, payload.chunks - run * kChunksPerRun);
}

// Plaintext of one run, and what stopped it, if anything did.
struct Run {
  Bytes buffer;
  std::size_t authentic_size = 0;
  std::exception_ptr error;
  bool ready = false;

  void decrypt(const AgePayload& payload, AgeChunkReader& reader, std::uint64_t number) {
    const std::uint64_t first = number * kChunksPerRun;
    const std::uint64_t count = chunks_in_run(payload, number);
    buffer.resize(kChunksPerRun * kAgeChunkSize);
    error = nullptr;
    try {
      reader.read(first, count, std::span(buffer).first(reader.plaintext_size(first, count)), authentic_size);
    } catch (...) {
      error = std::current_exception();
    }
  }
  [[nodiscard]] ByteView plaintext() const { return ByteView(buffer).first(authentic_size); }
};

// Workers decrypt runs ahead into a ring; the calling thread empties it in order.
class OrderedReading {
 public:
  OrderedReading(const AgePayload& payload, unsigned threads) : payload_(payload), ring_(2 * threads) {
    for (unsigned i = 0; i < threads; ++i) workers_.emplace_back([this] { work(); });
  }
  OrderedReading(const OrderedReading&) = delete;
  OrderedReading& operator=(const OrderedReading&) = delete;
  ~OrderedReading() {
    {
      const std::lock_guard lock(mutex_);
      stopped_ = true;
    }
    room_.notify_all();
    for (auto& worker : workers_) worker.join();
  }

  void deliver_to(const ByteSink& sink) {
    for (std::uint64_t number = 0; number < run_count(payload_); ++number) {
      Run& run = ring_[number % ring_.size()];
      {
        std::unique_lock lock(mutex_);
        filled_.wait(lock, [&] { return run.ready; });
      }
      sink(run.plaintext());
      if (run.error) std::rethrow_exception(run.error);
      {
        const std::lock_guard lock(mutex_);
        run.ready = false;
        ++delivered_;
      }
      room_.notify_one();
    }
  }

 private:
  void work() {
    AgeChunkReader reader(payload_);
    while (true) {
      std::uint64_t number = 0;
      {
        std::unique_lock lock(mutex_);
        room_.wait(lock, [&] {
          return stopped_ || next_ < delivered_ + ring_.size() || next_ == run_count(payload_);
        });
        if (stopped_ || next_ == run_count(payload_)) return;
        number = next_++;
      }
      Run& run = ring_[number % ring_.size()];  // this thread's alone until it is ready
      run.decrypt(payload_, reader, number);
      {
        const std::lock_guard lock(mutex_);
        run.ready = true;
      }
      filled_.notify_one();
    }
  }

  const AgePayload& payload_;
  std::vector<Run> ring_;
  std::mutex mutex_;
  std::condition_variable filled_, room_;
  std::uint64_t next_ = 0;       // run to be decrypted next
  std::uint64_t delivered_ = 0;  // runs that the sink has had
  bool stopped_ = false;
  std::vector<std::thread> workers_;
};

void write_at(int file_descriptor, const std::filesystem::path& name, ByteView bytes, std::uint64_t offset) {
  while (!bytes.empty()) {
    const ssize_t written = ::pwrite(file_descriptor, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw IoError("write", name, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
}

// Hands out runs in order and remembers the first one that failed, so that everything before it gets written.
class RunQueue {
 public:
  explicit RunQueue(std::uint64_t runs) : end_(runs) {}
  /// The next run; `end` when there is none.
  bool take(std::uint64_t& number) {
    const std::lock_guard lock(mutex_);
    if (next_ >= end_) return false;
    number = next_++;
    return true;
  }
  void failed(std::uint64_t number, std::uint64_t plaintext_end, std::exception_ptr error) {
    const std::lock_guard lock(mutex_);
    if (number >= end_) return;  // behind an earlier failure
    end_ = number;
    plaintext_end_ = plaintext_end;
    error_ = std::move(error);
  }
  [[nodiscard]] std::exception_ptr error() const { return error_; }
  [[nodiscard]] std::uint64_t plaintext_end() const { return plaintext_end_; }

 private:
  std::mutex mutex_;
  std::uint64_t next_ = 0;
  std::uint64_t end_;
  std::uint64_t plaintext_end_ = 0;
  std::exception_ptr error_;
};

}  // namespace

void read_payload_in_order(const AgePayload& payload, const ByteSink& sink, unsigned threads) {
  if (threads > 1 && run_count(payload) > 1) {
    OrderedReading(payload, threads).deliver_to(sink);
    return;
  }
  AgeChunkReader reader(payload);
  Run run;
  for (std::uint64_t number = 0; number < run_count(payload); ++number) {
    run.decrypt(payload, reader, number);
    sink(run.plaintext());
    if (run.error) std::rethrow_exception(run.error);
  }
}

void write_payload_to_file(const AgePayload& payload, int file_descriptor, const std::filesystem::path& name,
                           const ByteProgress& progress, unsigned threads) {
  RunQueue queue(run_count(payload));
  std::mutex written_mutex;
  std::uint64_t written = 0;
  WriteBehind behind(file_descriptor);
  const auto work = [&] {
    AgeChunkReader reader(payload);
    Run run;
    std::uint64_t number = 0;
    while (queue.take(number)) {
      run.decrypt(payload, reader, number);
      const std::uint64_t offset = number * kChunksPerRun * kAgeChunkSize;
      try {
        write_at(file_descriptor, name, run.plaintext(), offset);
        const std::lock_guard lock(written_mutex);
        written += run.plaintext().size();
        behind.wrote_until(written);
        if (progress) progress(written);
      } catch (...) {
        run.error = std::current_exception();
      }
      if (run.error) queue.failed(number, offset + run.authentic_size, run.error);
    }
  };
  std::vector<std::thread> helpers;
  for (unsigned i = 1; i < threads && i < run_count(payload); ++i) helpers.emplace_back(work);
  work();
  for (auto& helper : helpers) helper.join();
  if (!queue.error()) return;
  if (::ftruncate(file_descriptor, static_cast<off_t>(queue.plaintext_end())) != 0)
    throw IoError("cut", name, errno);
  std::rethrow_exception(queue.error());
}

}  // namespace kiroku::crypto
