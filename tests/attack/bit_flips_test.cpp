// One bit changed anywhere in a case is told, with the file it is in. Small files are gone through byte by
// byte (the bit moves on with the byte), long ones at their borders, at the borders of their chunks, and at
// places drawn with a fixed seed. KIROKU_FLIP_EVERY=N tries one place in N: of each flip a sanitizer sees
// much the same.
#include <algorithm>
#include <random>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "tests/attack/attacked_case.h"
#include "tests/support/asked_number.h"
#include "tests/support/report_text.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using archive::Finding;
using archive::Verdict;
using archive::VerificationReport;

std::size_t flip_step() { return std::max<std::size_t>(1, asked_number("KIROKU_FLIP_EVERY", 1)); }

class BitFlips : public ::testing::Test {
 protected:
  /// Flips one bit, verifies, and puts it back.
  VerificationReport verify_flipped(const std::string& file, std::size_t position, unsigned bit) {
    const std::string sound = read_file(case_ / file);
    std::string flipped = sound;
    flipped[position] = static_cast<char>(static_cast<unsigned char>(flipped[position]) ^ (1U << bit));
    write_file(case_ / file, flipped);
    VerificationReport report = case_.verify(false);
    write_file(case_ / file, sound);
    return report;
  }

  /// Every flip must be told with this file named.
  void expect_told(const std::string& file, const std::set<std::size_t>& positions) {
    ASSERT_FALSE(positions.empty());
    std::size_t nth = 0;
    for (const std::size_t position : positions) {
      if (nth++ % flip_step() != 0) continue;
      const VerificationReport report = verify_flipped(file, position, static_cast<unsigned>(position % 8));
      const bool named =
          std::any_of(report.findings.begin(), report.findings.end(), [&](const Finding& finding) {
            return finding.severity == archive::Severity::kTampered && finding.file == file;
          });
      ASSERT_EQ(report.verdict, Verdict::kTampered) << file << " byte " << position << details(report);
      ASSERT_TRUE(named) << file << " byte " << position << details(report);
    }
    EXPECT_EQ(summary(case_.verify()), "intact");
  }

  [[nodiscard]] std::set<std::size_t> every(const std::string& file, std::size_t step) const {
    std::set<std::size_t> positions;
    for (std::size_t at = 0; at < fs::file_size(case_ / file); at += step) {
      positions.insert(at);
    }
    return positions;
  }

  [[nodiscard]] std::set<std::size_t> sample(const std::string& file, std::size_t count) const {
    const std::size_t size = fs::file_size(case_ / file);
    std::mt19937_64 random(size);
    std::set<std::size_t> positions;
    while (positions.size() < count) {
      positions.insert(random() % size);
    }
    for (std::size_t edge = 0; edge < 20; ++edge) {
      positions.insert({edge, size - 1 - edge});
    }
    return positions;
  }

  AttackedCase case_;
};

TEST_F(BitFlips, InEveryByteOfTheLedgersFirstHalfAreTold) {
  std::set<std::size_t> positions = every("ledger.jsonl", 3);
  positions.erase(positions.lower_bound(fs::file_size(case_ / "ledger.jsonl") / 2), positions.end());
  expect_told("ledger.jsonl", positions);
}

TEST_F(BitFlips, InEveryByteOfTheLedgersSecondHalfAreTold) {
  std::set<std::size_t> positions = every("ledger.jsonl", 3);
  positions.erase(positions.begin(), positions.lower_bound(fs::file_size(case_ / "ledger.jsonl") / 2));
  expect_told("ledger.jsonl", positions);
}

TEST_F(BitFlips, InEveryLineEndOfTheLedgerAreToldForEachBit) {
  const std::string ledger = read_file(case_ / "ledger.jsonl");
  for (std::size_t at = ledger.find('\n'); at != std::string::npos; at = ledger.find('\n', at + 1)) {
    for (unsigned bit = 0; bit < 8; ++bit) {
      const VerificationReport report = verify_flipped("ledger.jsonl", at, bit);
      ASSERT_EQ(report.verdict, Verdict::kTampered) << "byte " << at << " bit " << bit << details(report);
    }
  }
}

TEST_F(BitFlips, InEveryByteOfTheCheckpointsAreTold) {
  for (const char* note : {"checkpoints/00000001.note", "checkpoints/00000006.note",
                           "checkpoints/00000010.note", "checkpoints/00000011.note"}) {
    expect_told(note, every(note, 1));
  }
}

TEST_F(BitFlips, InTheTokensAreTold) {
  for (const char* token : {"tokens/00000001.embedded.tsr", "tokens/00000006.embedded.tsr"}) {
    expect_told(token, sample(token, 100));
  }
  expect_told("tokens/00000010.embedded.tsr", every("tokens/00000010.embedded.tsr", 5));
}

TEST_F(BitFlips, InTheSegmentsAreTold) {
  const std::string film = "segments/endoscope/00000001.ts.age";
  const std::string text = read_file(case_ / film);
  const std::size_t header = text.find('\n', text.find("\n--- ") + 1) + 1;
  std::set<std::size_t> positions = sample(film, 100);
  for (std::size_t at = 0; at < header + 16; at += 2) {
    positions.insert(at);  // header and payload nonce
  }
  const std::size_t second_chunk = header + 16 + 65536 + 16;
  for (std::size_t near = second_chunk - 20; near < second_chunk + 4; ++near) {
    positions.insert(near);
  }
  expect_told(film, positions);
  for (const char* other : {"segments/endoscope/00000000.ts.age", "segments/endoscope/00000002.ts.age",
                            "segments/vitals/00000000.jsonl.age"}) {
    expect_told(other, sample(other, 30));
  }
}

TEST_F(BitFlips, InTheSubjectAreTold) { expect_told("subject.json.age", every("subject.json.age", 2)); }

TEST_F(BitFlips, InASegmentNameTheChunkWithAnIdentity) {
  const std::string film = "segments/endoscope/00000001.ts.age";
  const std::string sound = read_file(case_ / film);
  const std::size_t header = sound.find('\n', sound.find("\n--- ") + 1) + 1;
  archive::VerifyOptions options = SoundCases::get().archive.options();
  options.identities = &SoundCases::get().archive.identities();
  const std::size_t chunks = header + 16;
  const std::size_t second = chunks + 65536 + 16;
  for (const auto& [position, offset] : std::vector<std::pair<std::size_t, std::size_t>>{
           {3, 0}, {chunks, chunks}, {second - 1, chunks}, {second, second}, {sound.size() - 1, second}}) {
    std::string flipped = sound;
    flipped[position] = static_cast<char>(flipped[position] ^ 1);
    write_file(case_ / film, flipped);
    const VerificationReport report = archive::verify_case(case_.folder(), options);
    ASSERT_EQ(summary(report), "tampered\nfile-hash-differs " + film + " 4") << details(report);
    EXPECT_EQ(report.findings[0].offset, offset) << position;
  }
}

// Nothing is proven with these two, so nothing is lost with them.
TEST_F(BitFlips, InConveniencesChangeNoVerdict) {
  for (std::size_t at = 0; at < fs::file_size(case_ / "device.pub"); at += 7) {
    EXPECT_EQ(summary(verify_flipped("device.pub", at, 0)), "intact\ndevice-file-differs device.pub -");
  }
  for (std::size_t at = 0; at < fs::file_size(case_ / "authorities/embedded.pem"); at += 7) {
    EXPECT_THAT(summary(verify_flipped("authorities/embedded.pem", at, 0)),
                ::testing::AnyOf("intact", "intact\nauthority-file-malformed authorities/embedded.pem -"));
  }
}

TEST_F(BitFlips, InTheLogAreTold) {
  const std::string sound = read_file(case_.log() / "ledger.jsonl");
  for (std::size_t at = 0; at < sound.size(); at += 11) {
    std::string flipped = sound;
    flipped[at] = static_cast<char>(flipped[at] ^ (1 << (at % 8)));
    write_file(case_.log() / "ledger.jsonl", flipped);
    ASSERT_EQ(archive::verify_log(case_.log(), SoundCases::get().archive.options()).verdict,
              Verdict::kTampered)
        << "byte " << at;
    // The case is as it was, and what the log said of it is not known any more.
    const VerificationReport report = case_.verify();
    ASSERT_EQ(report.verdict, Verdict::kUnproven) << "byte " << at << details(report);
    ASSERT_THAT(summary(report), ::testing::HasSubstr(" log/")) << "byte " << at;
  }
}

}  // namespace
}  // namespace kiroku::test
