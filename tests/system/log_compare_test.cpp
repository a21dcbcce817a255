// Two appliance logs side by side, by the program that people run.
#include <algorithm>
#include <filesystem>
#include <sys/stat.h>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LogCompare : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    EXPECT_FALSE(record().empty());
  }
  [[nodiscard]] std::string log() const { return (home() / "archive/log").string(); }
  /// As an auditor exports it.
  [[nodiscard]] std::string exported(const std::string& name) const {
    fs::copy(log(), folder() / name, fs::copy_options::recursive);
    return path(name);
  }
  /// The device goes on from a copy of its home, as from a backup that was put back.
  void record_in_copy_of_home() const {
    fs::copy(home(), folder() / "copy", fs::copy_options::recursive);
    EXPECT_EQ(kiroku({"record", "--home", path("copy"), "--json", "--duration", "00:00:01", "--endoscope",
                      "synthetic:endoscope?size=64x48&rate=10&speed=max"})
                  .status,
              0);
  }
};

TEST_F(LogCompare, AnExportedLogIsTheBeginningOfTheHomes) {
  const std::string before = exported("before");
  const ProcessResult same = kiroku({"log", "compare", before, home().string()});
  EXPECT_EQ(same.status, 0) << same.out << same.err;
  EXPECT_THAT(same.out, HasSubstr("SAME: both are one history of "));
  EXPECT_FALSE(record().empty());
  const ProcessResult later = kiroku({"log", "compare", before, (home() / "archive").string()});
  EXPECT_EQ(later.status, 0) << later.out;
  EXPECT_THAT(later.out, HasSubstr("ONE HISTORY: " + log() + " goes on from " + before));
  const nlohmann::json told = kiroku_json({"log", "compare", before, log(), "--json"});
  EXPECT_EQ(told["relation"], "first-begins");
  EXPECT_EQ(told["common_entries"], told["logs"][0]["entries"]);
  EXPECT_GT(told["logs"][1]["entries"], told["common_entries"]);
}

TEST_F(LogCompare, ABackupThatWentOnIsASecondHistoryWithItsEntriesAndCheckpointsNamed) {
  record_in_copy_of_home();
  EXPECT_FALSE(record().empty());
  const Arguments compare{"log", "compare", home().string(), path("copy")};
  const ProcessResult told = kiroku(compare);
  EXPECT_EQ(told.status, 1) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("TWO HISTORIES: one device signed both"));
  EXPECT_THAT(told.out,
              HasSubstr("or its recorder wrote to another disk for a time, or went on from an older "
                        "copy that was put back."));
  EXPECT_THAT(told.out, HasSubstr("case-opened  case="));
  EXPECT_THAT(told.out, HasSubstr("The key: " + read_text(home() / "device.pub").substr(0, 8)));
  Arguments as_json = compare;
  as_json.emplace_back("--json");
  const ProcessResult json = kiroku(as_json);
  EXPECT_EQ(json.status, 1);
  const nlohmann::json object = nlohmann::json::parse(json.out);
  EXPECT_TRUE(object["two_histories"]);
  for (const nlohmann::json& side : object["logs"]) {
    EXPECT_EQ(side["entry"]["seq"], object["common_entries"]);
    // What is named is there, signed by the device, of just this size.
    const std::string note = read_text(side["checkpoint"]["file"].get<std::string>());
    EXPECT_THAT(note, HasSubstr("\n" + std::to_string(side["checkpoint"]["size"].get<int>()) + "\n"));
  }
  EXPECT_NE(object["logs"][0]["checkpoint"]["root"], object["logs"][1]["checkpoint"]["root"]);
  // The two checkpoints alone say no less, where they are of one size.
  const std::string one = object["logs"][0]["checkpoint"]["file"],
                    two = object["logs"][1]["checkpoint"]["file"];
  const ProcessResult notes = kiroku({"log", "compare", one, two});
  EXPECT_EQ(notes.status, 1) << notes.out;
  EXPECT_THAT(notes.out, HasSubstr("TWO HISTORIES"));
}

// Whoever makes a key of the device's name can sign two histories with it, and accuse the device of them.
TEST_F(LogCompare, TwoHistoriesOfAStrangersKeyAreNoneOfTheDeviceThatIsAskedFor) {
  record_in_copy_of_home();
  EXPECT_FALSE(record().empty());
  EXPECT_EQ(kiroku({"init", "--demo", "--home", path("accused")}).status, 0);
  const Arguments compare{"log", "compare", home().string(), path("copy")};
  EXPECT_THAT(kiroku(compare).out, HasSubstr("Anybody can make a key of any name"));
  Arguments asked = compare;
  asked.insert(asked.end(), {"--device", path("accused/device.pub")});
  const ProcessResult told = kiroku(asked);
  EXPECT_EQ(told.status, 3) << told.out;
  EXPECT_THAT(told.out, HasSubstr("FORKED: one key signed both, and it is not one that was asked for."));
  EXPECT_THAT(told.out, testing::Not(HasSubstr("TWO HISTORIES")));
  asked.emplace_back("--json");
  EXPECT_EQ(nlohmann::json::parse(kiroku(asked).out)["by_asked_device"], false);
  asked = compare;
  asked.insert(asked.end(), {"--device", (home() / "device.pub").string()});
  EXPECT_EQ(kiroku(asked).status, 1);
}

TEST_F(LogCompare, AChangedCopyIsDamagedAndItsCheckpointsStillSpeakForTheOther) {
  const std::string changed = exported("changed");
  std::string ledger = read_text(fs::path(changed) / "ledger.jsonl");
  const std::size_t at = ledger.find("case-closed");
  ASSERT_NE(at, std::string::npos);
  ledger.replace(ledger.find("\"utc\":\"20", at) + 9, 1, "1");
  write_text(fs::path(changed) / "ledger.jsonl", ledger);
  const ProcessResult told = kiroku({"log", "compare", log(), changed});
  EXPECT_EQ(told.status, 1) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("FORKED: they part, and nothing shows that one device signed both."));
  EXPECT_THAT(told.out, HasSubstr("DAMAGED: "));
  EXPECT_THAT(told.out, HasSubstr("ledger-changed"));
  EXPECT_THAT(told.out, HasSubstr("of " + log() + ": these are what the device signed"));
  EXPECT_THAT(told.out, testing::Not(HasSubstr("TWO HISTORIES")));
}

TEST_F(LogCompare, LogsOfTwoDevicesAreNotCompared) {
  EXPECT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  EXPECT_EQ(kiroku({"record", "--home", path("other"), "--json", "--duration", "00:00:01", "--endoscope",
                    "synthetic:endoscope?size=64x48&rate=10&speed=max"})
                .status,
            0);
  const ProcessResult told = kiroku({"log", "compare", home().string(), path("other")});
  EXPECT_EQ(told.status, 3) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("NOT COMPARED: they are of different devices"));
  // One history, and not of the device that was asked for.
  const ProcessResult foreign =
      kiroku({"log", "compare", home().string(), log(), "--device", path("other/device.pub")});
  EXPECT_EQ(foreign.status, 3) << foreign.out;
  EXPECT_THAT(foreign.out, HasSubstr("(not signed by the device that was asked for)"));
  EXPECT_EQ(
      kiroku({"log", "compare", home().string(), log(), "--device", (home() / "device.pub").string()}).status,
      0);
}

// Whoever can write to a disk can make lines of a log, and name any device in them.
TEST_F(LogCompare, WhatNobodySignedIsSaidAndIsNoHistoryOfTheDevice) {
  const std::string longer = exported("longer"), without = exported("without");
  const std::string ledger = read_text(fs::path(log()) / "ledger.jsonl");
  const auto entries = std::count(ledger.begin(), ledger.end(), '\n');
  std::string forged;
  for (int i = 0; i < 2; ++i) {
    forged +=
        R"({"type":"access","seq":)" + std::to_string(entries + i) +
        R"(,"utc":"2026-11-26T20:00:00.000000Z","mono_ns":9000000000000000,"case":"*","what":"unlocked","who":"anna"})"
        "\n";
  }
  write_text(fs::path(longer) / "ledger.jsonl", ledger + forged);
  const std::string said = "nobody signed it from entry " + std::to_string(entries) + " on";
  const ProcessResult goes_on = kiroku({"log", "compare", longer, log()});
  EXPECT_EQ(goes_on.status, 3) << goes_on.out;
  EXPECT_THAT(goes_on.out, HasSubstr("ONE HISTORY"));
  EXPECT_THAT(goes_on.out, HasSubstr(said));
  const std::string number = std::to_string(entries);
  const std::string note = log() + "/checkpoints/" + std::string(8 - number.size(), '0') + number + ".note";
  EXPECT_EQ(kiroku({"log", "compare", longer, note}).status, 3);
  // What the other log's checkpoints cover is signed.
  fs::remove_all(fs::path(without) / "checkpoints");
  const ProcessResult covered = kiroku({"log", "compare", without, log()});
  EXPECT_EQ(covered.status, 0) << covered.out;
  EXPECT_THAT(covered.out, testing::Not(HasSubstr("nobody signed")));
  // Two alike that nobody signed name the device, and are not its.
  const ProcessResult alike =
      kiroku({"log", "compare", without, without, "--device", (home() / "device.pub").string()});
  EXPECT_EQ(alike.status, 3) << alike.out;
  EXPECT_THAT(alike.out, HasSubstr("nobody signed it from entry 0 on"));
  EXPECT_THAT(alike.out, HasSubstr("(not signed by the device that was asked for)"));
}

TEST_F(LogCompare, RefusesInASentence) {
  EXPECT_REFUSED(kiroku({"log", "compare", log(), path("absent")}), "it is not there");
  EXPECT_REFUSED(kiroku({"log", "compare", log(), folder().string()}), "give the folder of the log");
  const fs::path recorded = record();
  EXPECT_REFUSED(kiroku({"log", "compare", recorded.string(), log()}), "is a case, not an appliance log");
  ASSERT_EQ(::mkfifo(path("pipe").c_str(), 0600), 0);
  EXPECT_REFUSED(kiroku({"log", "compare", log(), path("pipe")}), "neither a folder nor a file");
  write_text(folder() / "text", "no note\n");
  const ProcessResult told = kiroku({"log", "compare", log(), path("text")});
  EXPECT_EQ(told.status, 3);
  EXPECT_THAT(told.out, HasSubstr("is neither a log nor a signed checkpoint of one"));
}

}  // namespace
}  // namespace kiroku::test
