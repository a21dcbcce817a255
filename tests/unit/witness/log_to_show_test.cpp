// Which checkpoint of a log its witnesses are shown.
#include <atomic>
#include <cstdio>
#include <fcntl.h>
#include <filesystem>
#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/storage/file_system.h"
#include "archive/writing/appliance_log.h"
#include "base/error.h"
#include "tests/support/temporary_folder.h"
#include "witness/cosigning.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::ThrowsMessage;

class LogThatIsShown : public testing::Test {
 protected:
  LogThatIsShown() { enter(3); }
  void enter(int entries) {
    const auto log = archive::ApplianceLog::open(archive::real_file_system(), folder(), key_, "or-1");
    for (int i = 0; i < entries; ++i) log->access("20261126T091502Z-3f9c21ab", "watched", "somebody");
    size_ = log->head().size;
  }
  [[nodiscard]] fs::path folder() const { return parent_.path() / "log"; }
  [[nodiscard]] fs::path note(std::uint64_t size) const { return folder() / archive::note_path(size); }
  [[nodiscard]] LogToShow shown() const {
    return read_log_to_show(folder(), crypto::verifier_key_of("or-1", key_));
  }

  test::TemporaryFolder parent_;
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  std::uint64_t size_ = 0;
};

TEST_F(LogThatIsShown, IsItsNewestCheckpointWithNothingBehind) {
  const LogToShow log = shown();
  EXPECT_EQ(log.checkpoint.size, size_);
  EXPECT_EQ(log.tree.size(), size_);
  EXPECT_THAT(words_of_rest(log), IsEmpty());
}

TEST_F(LogThatIsShown, GoesOnThoughAnOldNoteLiesUnderALargeNumber) {
  fs::copy(note(size_), note(99'999'999));
  enter(2);
  const LogToShow log = shown();
  EXPECT_EQ(log.checkpoint.size, size_);
  EXPECT_THAT(words_of_rest(log), ElementsAre(HasSubstr("checkpoints/99999999.note in the log's folder is no "
                                                        "checkpoint by this device over as many entries")));
  EXPECT_FALSE(is_rest_unsigned(log));
}

TEST_F(LogThatIsShown, GoesOnThoughSomebodyElsesNoteLiesUnderALargeNumber) {
  const crypto::SigningKey other = crypto::SigningKey::generate();
  std::ofstream(note(99'999'999), std::ios::binary) << crypto::sign_note(
      crypto::Checkpoint{archive::log_origin("or-1"), 99'999'999, {}}.to_text(), "or-1", other);
  EXPECT_EQ(shown().checkpoint.size, size_);
}

TEST_F(LogThatIsShown, IsRefusedWhereItsEndOrALineWasTakenAway) {
  const auto refuses =
      ThrowsMessage<Error>(HasSubstr("is not the one that its newest checkpoint was signed of"));
  std::ifstream stream(folder() / archive::kLedgerFile, std::ios::binary);
  const std::string before{std::istreambuf_iterator<char>(stream), {}};
  const auto write = [&](const std::string& text) {
    std::ofstream(folder() / archive::kLedgerFile, std::ios::binary) << text;
  };
  write(before.substr(0, before.rfind('\n', before.size() - 2) + 1));
  EXPECT_THAT([&] { (void)shown(); }, refuses);
  std::string other = before;
  other.replace(other.find("watched"), 7, "shownto");
  write(other);
  EXPECT_THAT([&] { (void)shown(); }, refuses);
  write(before);
  EXPECT_EQ(shown().checkpoint.size, size_);
}

TEST_F(LogThatIsShown, TellsWhereItGoesOnWithoutCheckpoints) {
  fs::remove(note(size_));
  LogToShow log = shown();
  EXPECT_EQ(log.checkpoint.size, size_ - 1);
  EXPECT_EQ(log.tree.size(), size_ - 1);
  EXPECT_THAT(words_of_rest(log), ElementsAre("The log goes on beyond that: 1 entry has no checkpoint yet."));
  EXPECT_FALSE(is_rest_unsigned(log)) << "a recorder that writes just now leaves one";
  fs::remove(note(size_ - 1));
  log = shown();
  EXPECT_THAT(words_of_rest(log),
              ElementsAre(HasSubstr("2 entries have no checkpoint yet, where one was to follow each")));
  EXPECT_TRUE(is_rest_unsigned(log));
}

TEST_F(LogThatIsShown, IsRefusedWithoutACheckpointByTheDevice) {
  const auto of_another = [&] {
    read_log_to_show(folder(), crypto::verifier_key_of("or-1", crypto::SigningKey::generate()));
  };
  EXPECT_THAT(of_another, ThrowsMessage<Error>(HasSubstr("no checkpoint of the log in")));
  fs::remove_all(folder() / archive::kCheckpointsFolder);
  EXPECT_THAT([&] { (void)shown(); },
              ThrowsMessage<Error>(HasSubstr("has no checkpoint that could be cosigned")));
}

// Whoever can write to the archive takes its checkpoints away while it is read, and puts them back.
TEST_F(LogThatIsShown, IsShownOrRefusedWhileItsCheckpointsComeAndGo) {
  const fs::path none = parent_.path() / "none", there = folder() / archive::kCheckpointsFolder;
  fs::create_directory(none);
  std::atomic<bool> ends = false;
  std::thread exchanging([&] {
    while (!ends) ::renameat2(AT_FDCWD, none.c_str(), AT_FDCWD, there.c_str(), RENAME_EXCHANGE);
  });
  for (int i = 0; i < 500; ++i) {
    try {
      (void)shown();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("checkpoint"));
    }
  }
  ends = true;
  exchanging.join();
}

}  // namespace
}  // namespace kiroku::witness
