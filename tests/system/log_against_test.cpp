// The appliance log, and a case, against notes that were kept elsewhere, by the programs that people run.
#include <algorithm>
#include <sstream>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class LogAgainst : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    case_ = record();
  }
  static fs::path log_of(const fs::path& home) { return home / "archive/log"; }
  static std::vector<std::string> lines_of(const fs::path& home) {
    std::vector<std::string> lines;
    std::istringstream text(read_text(log_of(home) / "ledger.jsonl"));
    for (std::string line; std::getline(text, line);) lines.push_back(line);
    return lines;
  }
  static std::vector<fs::path> notes_of(const fs::path& folder) {
    std::vector<fs::path> notes;
    for (const auto& each : fs::directory_iterator(folder / "checkpoints")) notes.push_back(each.path());
    std::sort(notes.begin(), notes.end());
    return notes;
  }
  /// The newest note of the log, copied out of the home as a mail would.
  [[nodiscard]] std::string keep_newest(const fs::path& home, const std::string& name) const {
    fs::copy_file(notes_of(log_of(home)).back(), path(name), fs::copy_options::overwrite_existing);
    return path(name);
  }
  [[nodiscard]] ProcessResult small_verifier(Arguments arguments) const {
    Process::Options run = options({});
    run.command = {built_file("kiroku-verify")};
    run.command.insert(run.command.end(), arguments.begin(), arguments.end());
    return run_process(run);
  }
  /// "code entry" of each finding about notes.
  static std::vector<std::string> about_notes(const std::string& json) {
    std::vector<std::string> found;
    const nlohmann::json report = nlohmann::json::parse(json);
    for (const auto& each : report.at("findings")) {
      const std::string code = each["code"];
      if (code.starts_with("outside-")) {
        found.push_back(code + (each["entry"].is_null() ? "" : " " + each["entry"].dump()));
      }
    }
    return found;
  }

  /// The home keeps the newest checkpoint itself, and would tell without the one that is given.
  static void forget_newest(const fs::path& home) { fs::remove(home / "newest-log.note"); }

  fs::path case_;
};

TEST_F(LogAgainst, ANoteThatWasKeptHoldsWhileTheLogGrows) {
  const std::string kept = keep_newest(home(), "kept.note");
  (void)record();
  const ProcessResult judged = kiroku({"log", "--verify", "--against", kept});
  EXPECT_EQ(judged.status, 0) << judged.out << judged.err;
  EXPECT_THAT(judged.out, HasSubstr("outside-note-holds"));
  EXPECT_THAT(judged.out,
              HasSubstr("entries behind the checkpoint that was kept were cut off was not checked"));
  forget_newest(home());
  EXPECT_THAT(kiroku({"log", "--verify"}).out,
              HasSubstr("whether the newest entries were cut off was not checked"));
  const ProcessResult small = small_verifier({"--as-log", log_of(home()).string(), "--device",
                                              (home() / "device.pub").string(), "--against", kept, "--json"});
  EXPECT_EQ(small.status, 0) << small.out << small.err;
  EXPECT_THAT(about_notes(small.out), testing::ElementsAre("outside-note-holds"));
  EXPECT_EQ(kiroku({"verify", "--as-log", log_of(home()).string(), "--against", kept}).status, 0);
}

// Without the key: the log's entries are signed one by one, so its beginning is always a sound log.
TEST_F(LogAgainst, EntriesThatWereCutOffAreTold) {
  const fs::path earlier = folder() / "earlier";
  fs::copy(log_of(home()), earlier, fs::copy_options::recursive);
  const std::string before = keep_newest(home(), "before.note");
  const fs::path second = record();
  const std::string kept = keep_newest(home(), "kept.note");
  const std::uint64_t size = lines_of(home()).size();
  // A whole case goes, and what the log knows of it.
  fs::remove_all(second);
  fs::remove_all(log_of(home()));
  fs::copy(earlier, log_of(home()), fs::copy_options::recursive);
  ASSERT_LT(lines_of(home()).size(), size);
  EXPECT_THAT(kiroku({"log", "--verify"}).out, HasSubstr("outside-note-rolled-back")) << "the home's own";
  forget_newest(home());
  ASSERT_EQ(kiroku({"log", "--verify"}).status, 0) << "only the note can tell";

  const ProcessResult judged = kiroku({"log", "--verify", "--json", "--against", before, "--against", kept});
  EXPECT_EQ(judged.status, 1) << judged.err;
  EXPECT_THAT(
      about_notes(judged.out),
      testing::UnorderedElementsAre("outside-note-rolled-back " + std::to_string(lines_of(home()).size()),
                                    "outside-note-holds"));
  EXPECT_THAT(
      kiroku({"log", "--verify", "--against", kept}).out,
      HasSubstr("the last " + std::to_string(size - lines_of(home()).size()) + " entries were removed"));
}

TEST_F(LogAgainst, AnotherHistoryOfTheSameKeyIsToldByANoteAndByACopy) {
  const std::string common = keep_newest(home(), "common.note");
  const fs::path other = folder() / "other";
  fs::copy(home(), other, fs::copy_options::recursive);
  // Each home enters an access of its own.
  const Arguments look{"verify", "-i", (home() / "identity.txt").string()};
  for (const fs::path& each : {home(), other}) {
    Arguments arguments = look;
    arguments.insert(arguments.end(),
                     {"--home", each.string(), (each / "archive" / case_.filename()).string()});
    ASSERT_EQ(kiroku(arguments).status, 0);
  }
  const std::string kept = keep_newest(home(), "kept.note");
  forget_newest(other);
  ASSERT_EQ(kiroku({"log", "--verify", "--home", other.string()}).status, 0) << "only the note can tell";
  const std::uint64_t same =
      std::stoull(notes_of(log_of(other)).at(notes_of(log_of(other)).size() - 2).stem().string());

  for (const std::string& outside : {kept, log_of(home()).string()}) {
    const ProcessResult judged = kiroku(
        {"log", "--verify", "--json", "--home", other.string(), "--against", common, "--against", outside});
    EXPECT_EQ(judged.status, 1) << judged.err;
    EXPECT_THAT(
        about_notes(judged.out),
        testing::UnorderedElementsAre("outside-note-forked " + std::to_string(same), "outside-note-holds"));
  }
  // The two notes prove it also where no log is left.
  const std::string others = keep_newest(other, "other.note");
  fs::remove_all(log_of(other));
  const ProcessResult without =
      kiroku({"log", "--verify", "--json", "--home", other.string(), "--against", kept, "--against", others});
  EXPECT_EQ(without.status, 1) << without.out << without.err;
  EXPECT_THAT(about_notes(without.out), testing::Contains("outside-notes-contradict"));
}

TEST_F(LogAgainst, WhatCannotBeComparedIsNoAnswer) {
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("stranger"), "--device-name", "stranger"}).status, 0);
  Process::Options at_strangers =
      options({"record", "--endoscope", "synthetic:endoscope?size=160x120&speed=max", "--duration",
               "00:00:02", "--home", path("stranger")});
  ASSERT_EQ(run_process(at_strangers).status, 0);
  const std::string foreign = keep_newest(path("stranger"), "foreign.note");
  forget_newest(home());
  ProcessResult judged = kiroku({"log", "--verify", "--json", "--against", foreign});
  EXPECT_EQ(judged.status, 3) << judged.err;
  EXPECT_THAT(about_notes(judged.out), testing::ElementsAre("outside-note-untrusted"));

  const std::string of_case = path("case.note");
  fs::copy_file(notes_of(case_).back(), of_case);
  judged = kiroku({"log", "--verify", "--json", "--against", of_case});
  EXPECT_EQ(judged.status, 3) << judged.err;
  EXPECT_THAT(about_notes(judged.out), testing::ElementsAre("outside-note-of-other-origin"));

  std::string forged = read_text(keep_newest(home(), "kept.note"));
  forged.replace(forged.find('\n') + 1, 1, "9");
  write_text(path("forged.note"), forged);
  judged = kiroku({"log", "--verify", "--json", "--against", path("forged.note")});
  EXPECT_EQ(judged.status, 3) << judged.err;
  EXPECT_THAT(about_notes(judged.out), testing::ElementsAre("outside-note-invalid"));

  EXPECT_REFUSED(kiroku({"log", "--verify", "--against", path("absent.note")}), "absent.note");
  EXPECT_REFUSED(kiroku({"log", "--against", of_case}), "--verify");
  fs::create_directory(path("empty"));
  EXPECT_REFUSED(kiroku({"log", "--verify", "--against", path("empty")}), "no checkpoint in");
}

// Two machines were set up under one name, each with a key of its own, and the verifier trusts both.
TEST_F(LogAgainst, ANoteOfAnotherMachineOfTheSameNameAccusesNobody) {
  const std::string own_key = read_text(home() / "device.pub");
  const std::string name = own_key.substr(0, own_key.find('+'));
  const fs::path namesake = folder() / "namesake";
  ASSERT_EQ(kiroku({"init", "--demo", "--home", namesake.string(), "--device-name", name}).status, 0);
  const auto record_there = [&] {
    return run_process(options({"record", "--endoscope", "synthetic:endoscope?size=160x120&speed=max",
                                "--duration", "00:00:02", "--home", namesake.string()}))
        .status;
  };
  ASSERT_EQ(record_there(), 0);
  const Arguments both{"--device", (home() / "device.pub").string(), "--device",
                       (namesake / "device.pub").string()};
  const auto judged_by_both = [&](Arguments arguments) {
    arguments.insert(arguments.end(), both.begin(), both.end());
    arguments.emplace_back("--json");
    return small_verifier(arguments);
  };
  const auto expect_not_compared = [&](const ProcessResult& judged) {
    EXPECT_EQ(judged.status, 3) << judged.out << judged.err;
    EXPECT_THAT(about_notes(judged.out), testing::ElementsAre("outside-note-of-other-origin"));
  };
  // As many entries in both logs, then more there, then fewer.
  const std::string same = keep_newest(namesake, "same.note");
  ASSERT_EQ(record_there(), 0);
  const std::string more = keep_newest(namesake, "more.note");
  for (const std::string& note : {same, more, log_of(namesake).string()})
    expect_not_compared(judged_by_both({"--as-log", log_of(home()).string(), "--against", note}));
  expect_not_compared(judged_by_both({case_.string(), "--log", log_of(home()).string(), "--against", more}));
  const std::string own = keep_newest(home(), "own.note");
  ProcessResult judged =
      judged_by_both({"--as-log", log_of(home()).string(), "--against", same, "--against", own});
  EXPECT_EQ(judged.status, 3) << judged.out << judged.err;
  EXPECT_THAT(about_notes(judged.out),
              testing::UnorderedElementsAre("outside-note-holds", "outside-note-of-other-origin"));
  // Each by its own: both hold.
  EXPECT_EQ(judged_by_both({"--as-log", log_of(home()).string(), "--against", own}).status, 0);
  EXPECT_EQ(judged_by_both({"--as-log", log_of(namesake).string(), "--against", more}).status, 0);
}

// Whoever has the other machine's key carries a copy of the log on, and proves by it what they like.
TEST_F(LogAgainst, AnotherMachineOfTheSameNameCarriesNoLogOnAndProvesNoEnd) {
  const std::string own_key = read_text(home() / "device.pub");
  const std::string name = own_key.substr(0, own_key.find('+'));
  const std::string proof = path("case.tlog-proof");
  const Arguments devices{"--device", (home() / "device.pub").string(), "--device",
                          path("namesake/device.pub")};
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("namesake"), "--device-name", name}).status, 0);
  fs::remove_all(folder() / "namesake/archive");
  fs::copy(home() / "archive", folder() / "namesake/archive", fs::copy_options::recursive);
  ASSERT_EQ(run_process(options({"record", "--endoscope", "synthetic:endoscope?size=160x120&speed=max",
                                 "--duration", "00:00:02", "--home", path("namesake")}))
                .status,
            0);
  const fs::path copied = folder() / "namesake/archive" / case_.filename();
  const ProcessResult refused =
      kiroku({"log", "prove", copied.string(), "--home", path("namesake"), "-o", proof});
  EXPECT_EQ(refused.status, 2) << refused.out << refused.err;
  EXPECT_THAT(refused.err, HasSubstr("names another device"));
  EXPECT_FALSE(fs::exists(proof));
  // Beside the case its log says what the case's own device signed of it, and no more.
  Arguments arguments{case_.string(), "--log", path("namesake/archive/log"), "--json"};
  arguments.insert(arguments.end(), devices.begin(), devices.end());
  const ProcessResult judged = small_verifier(arguments);
  const nlohmann::json report = nlohmann::json::parse(judged.out);
  EXPECT_NE(report["verdict"], "tampered") << judged.out;
  for (const auto& each : report["findings"])
    EXPECT_THAT(each["code"].get<std::string>(), testing::Not(testing::StartsWith("log-"))) << judged.out;
  EXPECT_TRUE(report["log"]["end"].get<bool>()) << "in its own device's lines";
}

TEST_F(LogAgainst, ACaseIsComparedWithItsReceipt) {
  const std::string receipt = path("receipt.note");
  fs::copy_file(notes_of(case_).back(), receipt);
  const ProcessResult judged = kiroku({"verify", "--json", case_.string(), "--against", receipt});
  EXPECT_EQ(judged.status, 0) << judged.out << judged.err;
  EXPECT_THAT(about_notes(judged.out), testing::ElementsAre("outside-note-holds"));
  const fs::path second = record();
  EXPECT_EQ(kiroku({"verify", second.string(), "--against", receipt}).status, 3);
  EXPECT_REFUSED(kiroku({"verify", case_.string(), second.string(), "--against", receipt}), "one by one");
}

// Who may invite a guest chooses the guest's name.
TEST_F(LogAgainst, ATextOfTheLogCannotBeTakenForTwoFields) {
  const std::string boot = lines_of(home()).front();
  const std::string long_text(3'000, 'w');
  const auto access = [](int seq, const std::string& what) {
    return R"({"type":"access","seq":)" + std::to_string(seq) +
           R"(,"utc":"2026-08-05T09:15:02.000000Z","mono_ns":1,"case":"*","what":")" + what +
           R"(","who":"a-surgeon"})" + "\n";
  };
  write_text(log_of(home()) / "ledger.jsonl", boot + "\n" + access(1, "invited Y  who=a-director") +
                                                  access(2, "a\\u202eb c") + access(3, long_text));
  const std::string listed = kiroku({"log"}).out;
  EXPECT_THAT(listed, HasSubstr(R"(case=*  what="invited Y  who=a-director"  who=a-surgeon)"));
  EXPECT_THAT(listed, HasSubstr(R"(\\u{202E}b c)")) << "and shows what turns a line round";
  EXPECT_THAT(listed, HasSubstr("\u2026 (3000 bytes; --json has all)  who=a-surgeon"));
  EXPECT_THAT(listed, testing::Not(HasSubstr(std::string(1'100, 'w'))));
  const nlohmann::json entries = kiroku_json({"log", "--json"})["entries"];
  ASSERT_EQ(entries.size(), 4U);
  EXPECT_EQ(entries[3]["what"], long_text);
  EXPECT_EQ(entries[2]["what"],
            "a\u202e"
            "b c");
}

}  // namespace
}  // namespace kiroku::test
