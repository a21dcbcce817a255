#include "archive/verify/log_histories.h"

#include <filesystem>
#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A log that somebody with a key writes: line by line, with or without a checkpoint.
class WrittenLog {
 public:
  WrittenLog(fs::path folder, std::string name, const crypto::SigningKey& key,
             const std::string& boot = "boot-1")
      : folder_(std::move(folder)), name_(std::move(name)), key_(&key) {
    fs::create_directories(folder_ / kCheckpointsFolder);
    add(BootEntry{boot, device()});
  }

  [[nodiscard]] std::string device() const {
    return crypto::VerifierKey(name_, key_->public_key()).to_string();
  }
  [[nodiscard]] const fs::path& folder() const { return folder_; }
  void exchange_key(const crypto::SigningKey& key) {
    key_ = &key;
    add(DeviceKeyChangedEntry{device()});
  }
  void add(const LogEntryBody& body, bool is_signed = true) {
    add_line(to_line({tree_.size(), {*parse_utc("2026-08-05T09:15:02.000000Z"), 0}, body}), is_signed);
  }
  void add_line(const std::string& line, bool is_signed = true) {
    std::ofstream(folder_ / kLedgerFile, std::ios::binary | std::ios::app) << line << '\n';
    tree_.append(crypto::merkle_leaf_hash(bytes_of(line)));
    if (is_signed) std::ofstream(folder_ / note_path(tree_.size()), std::ios::binary) << note(tree_.size());
  }
  [[nodiscard]] std::string note(std::uint64_t size) const {
    return crypto::sign_note(crypto::Checkpoint{log_origin(name_), size, tree_.root(size)}.to_text(), name_,
                             *key_);
  }
  [[nodiscard]] LogHistory read() const { return read_history(folder_, {}); }
  [[nodiscard]] LogHistory kept(std::uint64_t size) const {
    return history_of_note({"kept.note", note(size)});
  }
  /// As somebody copied it just now.
  [[nodiscard]] WrittenLog copy(const fs::path& to) const {
    fs::copy(folder_, to, fs::copy_options::recursive);
    WrittenLog other(*this);
    other.folder_ = to;
    return other;
  }

 private:
  fs::path folder_;
  std::string name_;
  const crypto::SigningKey* key_;
  crypto::MerkleTree tree_;
};

LogEntryBody opened(const std::string& end) {
  return CaseOpenedEntry{"20260805T091502Z-0000000" + end, crypto::sha256(bytes_of(end))};
}

class LogHistories : public testing::Test {
 protected:
  LogHistories() { log.add(opened("1")); }

  const test::TemporaryFolder folder;
  const crypto::SigningKey key = crypto::SigningKey::generate();
  const crypto::SigningKey other_key = crypto::SigningKey::generate();
  WrittenLog log{folder / "log", "or3", key};
};

TEST_F(LogHistories, OneIsTheOthersBeginningOrTheSame) {
  WrittenLog later = log.copy(folder / "later");
  HistoryComparison compared = compare_histories(log.read(), later.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kSame);
  EXPECT_EQ(compared.common, 2U);
  later.add(ShutdownEntry{});
  compared = compare_histories(log.read(), later.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kFirstBegins);
  EXPECT_EQ(compared.common, 2U);
  EXPECT_FALSE(compared.two_histories());
  EXPECT_EQ(compare_histories(later.read(), log.read(), {}).relation, HistoryRelation::kSecondBegins);
}

TEST_F(LogHistories, OneKeyThatSignedBothToldTwoHistories) {
  WrittenLog second = log.copy(folder / "second");
  log.add(ShutdownEntry{}, false);
  log.add(opened("2"));
  second.add(opened("3"));
  const HistoryComparison compared = compare_histories(log.read(), second.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kForked);
  EXPECT_EQ(compared.common, 2U);
  ASSERT_TRUE(compared.two_histories());
  EXPECT_EQ(compared.first->device, log.device());
  EXPECT_EQ(compared.first->checkpoint.size, 4U) << "the first that is signed behind the parting";
  EXPECT_EQ(compared.second->checkpoint.size, 3U);
  // What the comparison names is what lies there, signed.
  const auto lies_there = crypto::Checkpoint::parse(crypto::open_note(second.note(3), {}).text);
  EXPECT_EQ(compared.second->checkpoint, *lies_there);
}

TEST_F(LogHistories, LinesThatNobodySignedProveNothingAgainstTheDevice) {
  WrittenLog second = log.copy(folder / "second");
  log.add(opened("2"));
  second.add(opened("3"), false);
  const HistoryComparison compared = compare_histories(log.read(), second.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kForked);
  EXPECT_FALSE(compared.two_histories());
  EXPECT_TRUE(compared.first);
  EXPECT_FALSE(compared.second);
}

// Whoever has a copy can go on from it with a key of their own, and say that the device's was exchanged.
TEST_F(LogHistories, AContinuationByAnotherKeyProvesNothingAgainstTheDevice) {
  WrittenLog second = log.copy(folder / "second");
  log.add(opened("2"));
  second.exchange_key(other_key);
  second.add(opened("3"));
  const HistoryComparison compared = compare_histories(log.read(), second.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kForked);
  EXPECT_FALSE(compared.two_histories());
  EXPECT_EQ(compared.first->device, log.device());
  EXPECT_EQ(compared.second->device, second.device());
}

TEST_F(LogHistories, AForkBehindAnExchangeOfTheKeyIsTheNewKeys) {
  log.exchange_key(other_key);
  WrittenLog second = log.copy(folder / "second");
  log.add(opened("2"));
  second.add(opened("3"));
  const HistoryComparison compared = compare_histories(log.read(), second.read(), {});
  ASSERT_TRUE(compared.two_histories());
  EXPECT_EQ(compared.first->device, log.device());
}

// A log that was thrown away and begun anew with the old key.
TEST_F(LogHistories, TwoFirstEntriesByOneKeyAreTwoHistories) {
  WrittenLog anew(folder / "anew", "or3", key, "boot-2");
  const HistoryComparison compared = compare_histories(log.read(), anew.read(), {});
  ASSERT_TRUE(compared.two_histories());
  EXPECT_EQ(compared.common, 0U);
  // Under another name it is another device: no log of the one is the other's.
  const WrittenLog renamed(folder / "renamed", "or4", key);
  EXPECT_EQ(compare_histories(log.read(), renamed.read(), {}).relation, HistoryRelation::kOtherDevices);
}

TEST_F(LogHistories, LogsOfDifferentDevicesAreNotCompared) {
  const WrittenLog foreign(folder / "foreign", "or4", other_key);
  const HistoryComparison compared = compare_histories(log.read(), foreign.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kOtherDevices);
  EXPECT_THAT(compared.why, HasSubstr("different devices, or3+"));
  EXPECT_EQ(compare_histories(log.read(), foreign.kept(1), {}).relation, HistoryRelation::kUnknown)
      << "nobody knows that key";
  EXPECT_EQ(
      compare_histories(log.read(), foreign.kept(1), {crypto::VerifierKey("or4", other_key.public_key())})
          .relation,
      HistoryRelation::kOtherDevices);
}

TEST_F(LogHistories, TwoKeysOfOneNameAreTwoDevices) {
  WrittenLog namesake(folder / "namesake", "or3", other_key);
  namesake.add(opened("9"));
  const std::vector<crypto::VerifierKey> known{crypto::VerifierKey("or3", key.public_key()),
                                               crypto::VerifierKey("or3", other_key.public_key())};
  for (const LogHistory& one : {log.read(), log.kept(2), log.kept(1)}) {
    for (const LogHistory& other : {namesake.read(), namesake.kept(2)})
      EXPECT_EQ(compare_histories(one, other, known).relation, HistoryRelation::kOtherDevices) << one.name;
  }
}

TEST_F(LogHistories, AKeptCheckpointIsOfTheLogOrOfAnotherHistory) {
  HistoryComparison compared = compare_histories(log.kept(1), log.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kFirstBegins);
  EXPECT_EQ(compared.common, 1U);
  EXPECT_EQ(compare_histories(log.read(), log.kept(2), {}).relation, HistoryRelation::kSame);

  WrittenLog second = log.copy(folder / "second");
  log.add(opened("2"));
  second.add(opened("3"));
  compared = compare_histories(log.read(), second.kept(3), {});
  ASSERT_TRUE(compared.two_histories());
  EXPECT_FALSE(compared.common) << "a checkpoint does not tell where";
  EXPECT_EQ(compared.second->checkpoint.size, 3U);
  EXPECT_EQ(compared.first->checkpoint.size, 3U);

  second.add(ShutdownEntry{});
  compared = compare_histories(log.read(), second.kept(4), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kUnknown);
  EXPECT_THAT(compared.why, HasSubstr("is of 4 entries, and"));
}

// The checkpoint before the parting is of both, so it proves nothing of the rest.
TEST_F(LogHistories, ACheckpointOfWhatBothHaveProvesNothingOfTheRest) {
  WrittenLog second = log.copy(folder / "second");
  second.add(opened("3"));
  log.add(opened("2"), false);
  const HistoryComparison compared = compare_histories(log.read(), second.kept(3), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kForked);
  EXPECT_FALSE(compared.first);
  EXPECT_FALSE(compared.two_histories());
}

TEST_F(LogHistories, TwoKeptCheckpointsOfOneSizeProveTwoHistoriesByThemselves) {
  WrittenLog second = log.copy(folder / "second");
  log.add(opened("2"));
  second.add(opened("3"));
  const std::vector<crypto::VerifierKey> known{crypto::VerifierKey("or3", key.public_key())};
  EXPECT_TRUE(compare_histories(log.kept(3), second.kept(3), known).two_histories());
  EXPECT_EQ(compare_histories(log.kept(2), second.kept(2), known).relation, HistoryRelation::kSame);
  EXPECT_THAT(compare_histories(log.kept(2), second.kept(3), known).why, HasSubstr("only the log's lines"));
  EXPECT_THAT(compare_histories(log.kept(3), second.kept(3), {}).why,
              HasSubstr("give its key with --device"));
}

TEST_F(LogHistories, AKeptCheckpointThatDoesNotHoldTellsNothing) {
  std::string changed = log.note(2);
  changed[changed.size() - 10] = changed[changed.size() - 10] == 'A' ? 'B' : 'A';
  const HistoryComparison compared =
      compare_histories(log.read(), history_of_note({"kept.note", changed}), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kUnknown);
  EXPECT_THAT(compared.why, HasSubstr("kept.note does not hold"));
  EXPECT_THAT(compare_histories(log.read(), history_of_note({"x", "no note\n"}), {}).why,
              HasSubstr("x is neither a log nor a signed checkpoint"));
  const std::string of_nothing =
      crypto::sign_note(crypto::Checkpoint{log_origin("or3"), 0, crypto::sha256({})}.to_text(), "or3", key);
  EXPECT_THAT(compare_histories(log.read(), history_of_note({"x", of_nothing}), {}).why,
              HasSubstr("is of no entry"));
}

TEST_F(LogHistories, WhatDoesNotHoldByItselfIsTold) {
  WrittenLog second = log.copy(folder / "second");
  second.add(opened("3"));
  second.add(ShutdownEntry{});
  EXPECT_TRUE(second.read().damage.empty());
  fs::resize_file(second.folder() / kLedgerFile, fs::file_size(second.folder() / kLedgerFile) - 5);
  const LogHistory cut = second.read();
  ASSERT_FALSE(cut.damage.empty());
  EXPECT_EQ(cut.damage.front().severity, Severity::kTampered);
  EXPECT_EQ(compare_histories(log.read(), cut, {}).relation, HistoryRelation::kFirstBegins);
}

// Lines behind one that cannot be read are not compared as if it were not there.
TEST_F(LogHistories, NothingIsSaidOfWhatCannotBeRead) {
  WrittenLog second = log.copy(folder / "second");
  second.add_line(std::string((1U << 20U) + 1, 'x'), false);
  second.add(opened("3"), false);
  HistoryComparison compared = compare_histories(log.read(), second.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kFirstBegins) << "the first one ends before that";
  log.add(opened("2"));
  compared = compare_histories(log.read(), second.read(), {});
  EXPECT_EQ(compared.relation, HistoryRelation::kUnknown);
  EXPECT_EQ(compared.common, 2U);
  EXPECT_THAT(compared.why, HasSubstr("what follows in " + second.folder().string() + " cannot be read"));
}

TEST_F(LogHistories, ALogWithoutEntriesBeginsNothing) {
  fs::create_directories(folder / "empty");
  std::ofstream(folder / "empty" / kLedgerFile).flush();
  EXPECT_THAT(compare_histories(log.read(), read_history(folder / "empty", {}), {}).why,
              HasSubstr("shows no entry"));
}

// Somebody's log that names another device in each line: none of them hides that one signed two histories.
TEST_F(LogHistories, OfALogWithManyDevicesTheOneThatSignedBothIsFound) {
  for (int i = 0; i < 200; ++i) log.exchange_key(i % 2 == 0 ? other_key : key);
  EXPECT_EQ(log.read().log.devices.size(), 2U);
  constexpr std::size_t kStrangers = 100;
  std::vector<crypto::SigningKey> keys;
  for (std::size_t i = 0; i < kStrangers; ++i) keys.push_back(crypto::SigningKey::generate());
  WrittenLog many(folder / "many", "or3", keys.front());
  for (const crypto::SigningKey& each : keys) many.exchange_key(each);
  const crypto::SigningKey both = crypto::SigningKey::generate();
  many.exchange_key(both);
  many.add(opened("1"));
  const LogHistory read = many.read();
  EXPECT_TRUE(read.damage.empty());
  EXPECT_EQ(read.log.devices.size(), kStrangers + 1);
  EXPECT_EQ(read.log.checkpoints.size(), kStrangers + 3);
  WrittenLog plain(folder / "plain", "or3", both);
  plain.add(opened("2"));
  for (const auto& [one, other] :
       {std::pair(plain.read(), many.read()), std::pair(many.read(), plain.read())}) {
    const HistoryComparison compared = compare_histories(one, other, {});
    EXPECT_EQ(compared.relation, HistoryRelation::kForked);
    EXPECT_TRUE(compared.two_histories());
    EXPECT_EQ(compared.first->device, plain.device());
  }
}

TEST_F(LogHistories, WhatIsNoLogIsRefused) {
  fs::create_directories(folder / "nothing");
  EXPECT_THROW(read_history(folder / "nothing", {}), UsageError);
  EXPECT_THROW(read_history(folder / "absent", {}), UsageError);
}

}  // namespace
}  // namespace kiroku::archive
