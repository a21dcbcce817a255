#include "archive/writing/segment_writer.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/age_file.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::ElementsAre;

constexpr std::size_t kChunk = 64U << 10U;

class SegmentWriterTest : public testing::Test {
 protected:
  std::unique_ptr<SegmentWriter> begin() {
    return std::make_unique<SegmentWriter>(files_, file_, "segments/room/00000000.ts.age", recipients_);
  }
  static std::string contents(const fs::path& file) {
    std::ifstream input(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(input), {}};
  }
  /// What the recipient gets out of a file, whole or cut short.
  [[nodiscard]] std::string plaintext_of(const fs::path& file) const {
    const auto source = crypto::open_file_source(file);
    const auto opened = crypto::AgeFile::open(*source, identities_, crypto::Truncation::kTolerate);
    std::string text;
    opened.read_all([&](ByteView bytes) { text += text_of(bytes); });
    return text;
  }
  static std::string film(std::size_t bytes) {
    std::string text(bytes, '\0');
    for (std::size_t i = 0; i < bytes; ++i) {
      text[i] = static_cast<char>(i * 7 + i / 256);
    }
    return text;
  }
  void expect_describes(const FileReference& reference, const fs::path& file) const {
    const std::string bytes = contents(file);
    EXPECT_EQ(reference.bytes, bytes.size());
    EXPECT_EQ(reference.sha256, crypto::sha256(bytes_of(bytes)));
  }

  TemporaryFolder folder_{test::quick_parent()};
  fs::path file_ = folder_ / "00000000.ts.age";
  fs::path part_ = folder_ / "00000000.ts.age.part";
  FaultFileSystem files_{folder_.path()};
  crypto::AgeKeyPair pair_ = crypto::generate_age_key();
  crypto::AgeRecipients recipients_{crypto::parse_recipient(pair_.recipient)};
  crypto::AgeIdentities identities_{crypto::parse_identity(pair_.identity_text.text())};
};

TEST_F(SegmentWriterTest, CommitsWhatTheRecipientReadsAndTheReferenceDescribes) {
  const std::string text = film(3 * kChunk + 100);
  const auto segment = begin();
  segment->write(bytes_of(text));
  segment->seal();
  const FileReference reference = segment->commit();
  EXPECT_EQ(reference.file, "segments/room/00000000.ts.age");
  expect_describes(reference, file_);
  EXPECT_EQ(plaintext_of(file_), text);
  EXPECT_FALSE(fs::exists(part_));
  EXPECT_EQ(segment->plaintext_bytes(), text.size());
  EXPECT_EQ(segment->bytes(), reference.bytes);
}

TEST_F(SegmentWriterTest, FlushesBeforeTheNameAndTheFolderAfter) {
  const auto segment = begin();
  segment->write(bytes_of("film"));
  segment->seal();
  files_.forget_calls();
  segment->commit();
  EXPECT_THAT(files_.calls(), ElementsAre("sync_all 00000000.ts.age.part",
                                          "rename 00000000.ts.age.part 00000000.ts.age", "sync_folder ."));
}

TEST_F(SegmentWriterTest, GivesEveryWholeChunkToTheKernelAtOnce) {
  const auto segment = begin();
  const std::uint64_t header = segment->bytes();
  segment->write(bytes_of(film(kChunk + 1)));
  EXPECT_EQ(fs::file_size(part_), header + kChunk + 16);
}

TEST_F(SegmentWriterTest, BeginsWritingBackEveryFewMegabytes) {
  const auto segment = begin();
  const std::string text = film(kChunk);
  for (int i = 0; i < 260; ++i) {  // 16.25 MiB
    segment->write(bytes_of(text));
  }
  const std::vector<std::string> calls = files_.calls();
  EXPECT_EQ(std::count(calls.begin(), calls.end(), "writeback 00000000.ts.age.part"), 2);
}

TEST_F(SegmentWriterTest, IsFlushedFromAnotherThreadWhileItIsWritten) {
  const std::string text = film(40 * kChunk);
  const auto segment = begin();
  std::thread flushing([&] {
    for (int i = 0; i < 5; ++i) {
      segment->sync();
    }
  });
  for (std::size_t at = 0; at < text.size(); at += kChunk) {
    segment->write(bytes_of(text).subspan(at, kChunk));
  }
  flushing.join();
  segment->seal();
  expect_describes(segment->commit(), file_);
  EXPECT_EQ(plaintext_of(file_), text);
}

TEST_F(SegmentWriterTest, SalvagesEveryByteThatIsOnTheDiskWhenItIsFull) {
  const std::string text = film(4 * kChunk);
  const auto segment = begin();
  segment->write(bytes_of(text));
  files_.fail("write", ENOSPC);
  EXPECT_THROW(segment->write(bytes_of(text)), IoError);
  EXPECT_THROW(segment->write(bytes_of(text)), Error) << "good for salvage only";
  EXPECT_THROW(segment->seal(), Error);
  EXPECT_THROW(segment->commit(), Error);
  files_.forget_calls();
  const std::optional<FileReference> reference = segment->salvage();
  ASSERT_TRUE(reference);
  EXPECT_EQ(reference->file, "segments/room/00000000.ts.age.part");
  expect_describes(*reference, part_);
  EXPECT_EQ(plaintext_of(part_), text.substr(0, 3 * kChunk)) << "the fourth chunk was never whole";
  EXPECT_THAT(files_.calls(), ElementsAre("sync_all 00000000.ts.age.part", "sync_folder ."));
}

TEST_F(SegmentWriterTest, SalvagesWhatASealCouldNotFinish) {
  const std::string text = film(kChunk + 10);
  const auto segment = begin();
  segment->write(bytes_of(text));
  files_.fail("write", ENOSPC);
  EXPECT_THROW(segment->seal(), IoError);
  const auto reference = segment->salvage();
  ASSERT_TRUE(reference);
  expect_describes(*reference, part_);
  EXPECT_EQ(plaintext_of(part_), text.substr(0, kChunk));
}

TEST_F(SegmentWriterTest, SalvagesWhatCouldNotBeRenamed) {
  const auto segment = begin();
  segment->write(bytes_of("film"));
  segment->seal();
  files_.fail("rename", ENOSPC);
  EXPECT_THROW(segment->commit(), IoError);
  const auto reference = segment->salvage();
  ASSERT_TRUE(reference);
  expect_describes(*reference, part_);
  EXPECT_EQ(plaintext_of(part_), "film");
}

TEST_F(SegmentWriterTest, SalvageRemovesAFileInWhichNoPictureCanBe) {
  const auto segment = begin();
  segment->write(bytes_of("film"));  // less than a chunk: only the header is in the file
  EXPECT_FALSE(segment->salvage());
  EXPECT_FALSE(fs::exists(part_));
}

TEST_F(SegmentWriterTest, IsNotSalvagedAfterAFailedFlush) {
  const auto segment = begin();
  segment->write(bytes_of(film(2 * kChunk)));
  files_.fail("sync ", EIO);
  EXPECT_THROW(segment->sync(), SyncError);
  files_.heal();
  files_.forget_calls();
  EXPECT_THROW(segment->sync(), Error);
  EXPECT_THROW(segment->write(bytes_of("x")), Error);
  EXPECT_THROW(segment->salvage(), Error);
  EXPECT_THAT(files_.calls(), ElementsAre()) << "a failed flush is never retried";
}

TEST_F(SegmentWriterTest, AFailedFlushAtTheEndIsFinal) {
  for (const char* step : {"sync_all", "sync_folder"}) {
    const TemporaryFolder folder;
    FaultFileSystem files(folder.path());
    SegmentWriter segment(files, folder / "s", "s", recipients_);
    segment.write(bytes_of("film"));
    segment.seal();
    files.fail(step, EIO);
    EXPECT_THROW(segment.commit(), SyncError) << step;
    files.heal();
    EXPECT_THROW(segment.commit(), Error) << step;
    EXPECT_THROW(segment.salvage(), Error) << step;
  }
}

TEST_F(SegmentWriterTest, LeavesNothingWhenNotEvenTheHeaderCanBeWritten) {
  files_.fail("write", ENOSPC);
  EXPECT_THROW(begin(), IoError);
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(SegmentWriterTest, IsWrittenOnce) {
  const auto segment = begin();
  EXPECT_THROW(begin(), IoError) << "the same part";
  segment->write(bytes_of("film"));
  EXPECT_THROW(segment->commit(), Error) << "not sealed";
  segment->seal();
  EXPECT_THROW(segment->write(bytes_of("more")), Error);
  segment->commit();
  EXPECT_THROW(segment->commit(), Error);
  EXPECT_THROW(segment->salvage(), Error);
}

TEST_F(SegmentWriterTest, AnAbandonedOneStaysAsPart) {
  begin()->write(bytes_of(film(kChunk + 1)));
  EXPECT_TRUE(fs::exists(part_));
  EXPECT_FALSE(fs::exists(file_));
}

}  // namespace
}  // namespace kiroku::archive
