#include "base/parallel.h"

#include <algorithm>
#include <atomic>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace kiroku {

void for_each_part(std::size_t parts, unsigned threads, const std::function<void(std::size_t)>& do_part) {
  std::atomic<std::size_t> next = 0;
  std::mutex failure_mutex;
  std::exception_ptr failure;
  const auto take = [&] {
    try {
      for (std::size_t part = next++; part < parts; part = next++) do_part(part);
    } catch (...) {
      next = parts;
      const std::lock_guard lock(failure_mutex);
      if (!failure) failure = std::current_exception();
    }
  };
  std::vector<std::thread> helpers;
  try {
    for (std::size_t i = 1; i < std::min<std::size_t>(threads, parts); ++i) helpers.emplace_back(take);
  } catch (const std::system_error&) {
    // The machine gives no more threads; those that are there suffice.
  }
  take();
  for (std::thread& helper : helpers) helper.join();
  if (failure) std::rethrow_exception(failure);
}

}  // namespace kiroku
