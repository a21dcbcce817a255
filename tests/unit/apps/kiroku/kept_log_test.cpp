#include "apps/kiroku/kept_log.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/writing/log_reading.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::apps {
namespace {

namespace fs = std::filesystem;
using testing::Contains;
using testing::HasSubstr;

class KeptLog : public testing::Test {
 protected:
  KeptLog() {
    std::ofstream(home_.device_file()) << crypto::verifier_key_of("or-1", key_).to_string() << "\n";
    fs::create_directory(home_.archive());
  }
  /// As a process of the home does.
  std::unique_ptr<archive::ApplianceLog> open() { return open_kept_log(home_, key_).log; }
  [[nodiscard]] std::vector<std::string> types() const {
    std::vector<std::string> types;
    for (const archive::LogLine& line : archive::read_log(home_.log_folder())) types.push_back(line.type);
    return types;
  }
  void take_newest_checkpoint_away() const {
    fs::remove(home_.log_folder() / archive::note_path(archive::read_log(home_.log_folder()).size()));
  }

  static constexpr const char* kCase = "20261126T091502Z-3f9c21ab";
  test::TemporaryFolder folder_;
  Home home_{folder_.path()};
  crypto::SigningKey key_ = crypto::SigningKey::generate();
};

// A recorder, the viewer as a process of its own, and a command that enters a hold and ends.
TEST_F(KeptLog, OfTwoProcessesNeitherCutsOffWhatTheOtherSigned) {
  const auto recorder = open();
  const auto viewer = open();
  viewer->access("*", "unlocked", "anna");
  recorder->case_opened(kCase, crypto::sha256({}));
  take_newest_checkpoint_away();
  viewer->access("*", "watched", "anna");
  EXPECT_THAT(types(), testing::ElementsAre("boot", "access", "case-opened", "access"));
  recorder->case_checkpoint(kCase, 5, crypto::sha256({}));
  open()->case_held(kCase, "court order", "ben");
  take_newest_checkpoint_away();
  for (const auto* each : {&recorder, &viewer}) (*each)->access("*", "locked", "anna");
  EXPECT_THAT(types(), Contains("case-held"));
  EXPECT_EQ(archive::is_signed_entry(home_.log_folder(), home_.device(), 5,
                                     archive::root_of_log(home_.log_folder(), 6)),
            true)
      << "its checkpoint is put back";
  EXPECT_THAT(recorder->remarks(), Contains(HasSubstr("somebody took it away")));
}

// Each replaces what the other one keeps: neither loses its file to it, nor keeps an earlier one.
TEST_F(KeptLog, TwoProcessesKeepTheNewestCheckpoint) {
  testing::internal::CaptureStderr();
  for (int rounds = 0; rounds < 5; ++rounds) {
    const auto recorder = open();
    const auto viewer = open();
    for (int i = 0; i < 5; ++i) {
      recorder->access("*", "unlocked", "anna");
      viewer->access("*", "locked", "anna");
    }
  }
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
  std::ifstream kept(home_.newest_log_note());
  std::string origin, size;
  std::getline(std::getline(kept, origin), size);
  EXPECT_EQ(size, std::to_string(archive::read_log(home_.log_folder()).size()));
}

// Its writer waited for a slow disk, and another process signed meanwhile.
TEST_F(KeptLog, ALateNoteDoesNotTakeTheNewerOnesPlace) {
  const fs::path file = folder_ / "last-signed.note";
  const auto remembered = [&] {
    std::ifstream input(file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(input), {});
  };
  auto log = open();
  log->access("*", "unlocked", "anna");
  const crypto::Checkpoint of_another{archive::log_origin("or-1"), 99, {}};
  const std::string newer = crypto::sign_note(of_another.to_text(), "or-1", key_);
  std::ofstream(file, std::ios::binary) << newer;
  log->access("*", "locked", "anna");
  log.reset();  // what is given is written by then
  EXPECT_EQ(remembered(), newer);
  // One of a log that was lost is no newer one.
  log = open();
  log->access("*", "unlocked", "anna");
  log.reset();
  EXPECT_THAT(remembered(), HasSubstr("\n" + std::to_string(types().size()) + "\n"));
}

TEST_F(KeptLog, WhereNothingCanBeRememberedEntriesAreMadeAllTheSame) {
  fs::create_directory(folder_ / "last-signed.note");
  const auto log = open();
  log->access("*", "unlocked", "anna");
  log->access("*", "locked", "anna");
  EXPECT_THAT(types(), testing::ElementsAre("boot", "access", "access"));
}

}  // namespace
}  // namespace kiroku::apps
