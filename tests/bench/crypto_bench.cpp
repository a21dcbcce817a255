// Sealing with all hashes against the limit that its two parts set: ChaCha20-Poly1305 and SHA-256 one after
// the other on one core, measured in the same run by bare loops over OpenSSL. Rates are of CPU time; of
// several repetitions the best one counts on both sides, because other work on the machine only ever slows.
//
//   crypto_bench --benchmark_repetitions=10 --benchmark_enable_random_interleaving=true
#include <algorithm>
#include <cstdio>
#include <map>
#include <string>

#include <benchmark/benchmark.h>

#include "crypto/age_file.h"
#include "crypto/hash.h"

namespace {

using namespace kiroku;          // NOLINT(google-build-using-namespace): a program of one file
using namespace kiroku::crypto;  // NOLINT(google-build-using-namespace)

constexpr std::int64_t kPiece = 64 * 1024;

void set_rate(benchmark::State& state, std::int64_t bytes_per_iteration) {
  state.SetBytesProcessed(static_cast<std::int64_t>(state.iterations()) * bytes_per_iteration);
}

// One key for all messages, a nonce and a tag for each, as any user of the cipher must.
void bare_chacha20_poly1305(benchmark::State& state) {
  const Bytes key(32, std::byte{7});
  Bytes nonce(12);
  Bytes plaintext(kPiece, std::byte{0x42});
  Bytes sealed(kPiece + 16);
  const CipherContext context(EVP_CIPHER_CTX_new());
  EVP_EncryptInit_ex2(context.get(), EVP_chacha20_poly1305(), openssl_bytes(ByteView(key)), nullptr, nullptr);
  int written = 0;
  for ([[maybe_unused]] auto _ : state) {
    nonce[0] ^= std::byte{1};
    EVP_EncryptInit_ex2(context.get(), nullptr, nullptr, openssl_bytes(ByteView(nonce)), nullptr);
    EVP_EncryptUpdate(context.get(), openssl_bytes(std::span(sealed)), &written,
                      openssl_bytes(ByteView(plaintext)), kPiece);
    EVP_EncryptFinal_ex(context.get(), openssl_bytes(std::span(sealed)) + kPiece, &written);
    EVP_CIPHER_CTX_ctrl(context.get(), EVP_CTRL_AEAD_GET_TAG, 16, sealed.data() + kPiece);
    benchmark::DoNotOptimize(sealed.data());
  }
  set_rate(state, kPiece);
}

void bare_sha256(benchmark::State& state) {
  const Bytes message(kPiece, std::byte{0x42});
  const DigestContext context(EVP_MD_CTX_new());
  EVP_DigestInit_ex2(context.get(), EVP_sha256(), nullptr);
  for ([[maybe_unused]] auto _ : state) EVP_DigestUpdate(context.get(), message.data(), message.size());
  set_rate(state, kPiece);
}

// What a segment writer does to each write, without the file: seal, and hash what leaves.
void seal_with_hash(benchmark::State& state) {
  const Bytes plaintext(static_cast<std::size_t>(state.range(0)), std::byte{0x42});
  Sha256 hash;
  AgeSealer sealer({parse_recipient(generate_age_key().recipient)},
                   [&](ByteView sealed) { hash.update(sealed); });
  for ([[maybe_unused]] auto _ : state) sealer.write(plaintext);
  set_rate(state, state.range(0));
}

void unseal(benchmark::State& state) {
  const AgeKeyPair key = generate_age_key();
  const Bytes sealed = seal_bytes(Bytes(64 << 20), {parse_recipient(key.recipient)});
  const auto source = memory_source(sealed);
  const AgeFile file = AgeFile::open(*source, {parse_identity(key.identity_text.text())});
  for ([[maybe_unused]] auto _ : state)
    file.read_all([](ByteView bytes) { benchmark::DoNotOptimize(bytes.data()); },
                  static_cast<unsigned>(state.range(0)));
  set_rate(state, 64 << 20);
}

BENCHMARK(bare_chacha20_poly1305);
BENCHMARK(bare_sha256);
BENCHMARK(seal_with_hash)->RangeMultiplier(4)->Range(kPiece, 4 << 20);
BENCHMARK(unseal)->Arg(1)->Arg(2)->UseRealTime();

// Prints as usual, and keeps the best rate of each benchmark.
class BestRates : public benchmark::ConsoleReporter {
 public:
  void ReportRuns(const std::vector<Run>& runs) override {
    ConsoleReporter::ReportRuns(runs);
    for (const auto& run : runs) {
      const auto rate = run.counters.find("bytes_per_second");
      if (run.run_type != Run::RT_Iteration || rate == run.counters.end()) continue;
      double& best =
          best_[run.run_name.function_name + (run.run_name.args.empty() ? "" : "/" + run.run_name.args)];
      best = std::max(best, rate->second.value);
    }
  }
  void print_best() const {
    for (const auto& [name, rate] : best_) std::printf("best %s: %.3f GB/s\n", name.c_str(), rate / 1e9);
    const auto cipher = best_.find("bare_chacha20_poly1305");
    const auto hash = best_.find("bare_sha256");
    if (cipher == best_.end() || hash == best_.end()) return;
    const double limit = 1 / (1 / cipher->second + 1 / hash->second);
    std::printf("limit of both in series: %.3f GB/s\n", limit / 1e9);
    for (const auto& [name, rate] : best_)
      if (name.starts_with("seal_with_hash"))
        std::printf("%s: %.3f of the limit\n", name.c_str(), rate / limit);
  }

 private:
  std::map<std::string, double> best_;
};

}  // namespace

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  BestRates reporter;
  benchmark::RunSpecifiedBenchmarks(&reporter);
  reporter.print_best();
  return 0;
}
