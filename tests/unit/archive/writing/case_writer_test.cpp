#include "archive/writing/case_writer.h"

#include <cerrno>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/ledger.h"
#include "archive/writing/log_reading.h"
#include "crypto/age_file.h"
#include "tests/support/case_kit.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::commit_segment;
using test::contents;
using test::entries_of;
using test::FaultFileSystem;
using test::lies_of;
using test::moment;
using test::TemporaryFolder;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

class CaseWriterTest : public testing::Test {
 protected:
  std::unique_ptr<CaseWriter> create() { return CaseWriter::create(files_, kit_.options(), moment(0)); }
  static TokenEntry facts() {
    TokenEntry facts;
    facts.gen_time = moment(0).utc;
    facts.accuracy_ns = 1'000'000'000;
    facts.serial = "0a";
    return facts;
  }

  TemporaryFolder folder_{test::quick_parent()};
  test::CaseKit kit_{folder_.path()};
  FaultFileSystem files_{folder_.path()};
};

TEST_F(CaseWriterTest, MakesTheFolderOfTheFormat) {
  const auto writer = create();
  EXPECT_TRUE(is_case_id(writer->case_id()));
  EXPECT_EQ(writer->case_id().substr(0, 17), "20260805T091502Z-");
  EXPECT_EQ(writer->folder(), folder_ / writer->case_id());
  for (const char* name : {"checkpoints", "tokens", "authorities", "segments/room", "segments/vitals"}) {
    EXPECT_TRUE(fs::is_directory(writer->folder() / name)) << name;
  }
  const crypto::VerifierKey device("theatre-1", kit_.key().public_key());
  EXPECT_EQ(contents(writer->folder() / "device.pub"), device.to_string() + "\n");
  EXPECT_THAT(lies_of(writer->folder(), kit_), IsEmpty());
}

TEST_F(CaseWriterTest, OpenStatesStreamsSubjectAndWhoCanReadThem) {
  auto options = kit_.options();
  options.plan = crypto::sha256(bytes_of("plan"));
  const auto writer = CaseWriter::create(files_, options, moment(5));
  const std::vector<CaseEntry> entries = entries_of(writer->folder());
  ASSERT_EQ(entries.size(), 1U);
  EXPECT_EQ(entries[0].at.mono_ns, 5);
  const auto& open = std::get<OpenEntry>(entries[0].body);
  EXPECT_EQ(open.case_id, writer->case_id());
  EXPECT_EQ(open.device, crypto::VerifierKey("theatre-1", kit_.key().public_key()).to_string());
  EXPECT_EQ(open.boot_id, "b1");
  EXPECT_EQ(open.plan, crypto::sha256(bytes_of("plan")));
  ASSERT_EQ(open.streams.size(), 2U);
  EXPECT_THAT(open.streams[0].recipients, ElementsAre(options.stream_recipients[0][0]->to_string()));
  EXPECT_EQ(open.appliance_log_size, 0U);
  EXPECT_EQ(open.appliance_log_root, crypto::sha256({}));
  const std::string sealed = contents(writer->folder() / "subject.json.age");
  EXPECT_EQ(text_of(crypto::unseal_bytes(bytes_of(sealed), kit_.identities())), R"({"patient":"A"})");
}

TEST_F(CaseWriterTest, TwoCasesOfOneSecondHaveFoldersOfTheirOwn) {
  const auto first = create();
  const auto second = create();
  EXPECT_NE(first->folder(), second->folder());
}

TEST_F(CaseWriterTest, RefusesStreamsThatAreNone) {
  for (const std::string& name : {std::string(), std::string("../x"), std::string("a/b"), std::string("Room"),
                                  std::string("-x"), std::string("."), std::string(33, 'a')}) {
    auto options = kit_.options();
    options.streams[0].name = name;
    EXPECT_THROW(CaseWriter::create(files_, options, moment(0)), UsageError) << name;
  }
  auto twice = kit_.options();
  twice.streams[1].name = "room";
  EXPECT_THROW(CaseWriter::create(files_, twice, moment(0)), UsageError);
  auto unknown = kit_.options();
  unknown.streams[0].media = "video/avi";
  EXPECT_THROW(CaseWriter::create(files_, unknown, moment(0)), UsageError);
  auto unreadable = kit_.options();
  unreadable.stream_recipients[1].clear();
  EXPECT_THROW(CaseWriter::create(files_, unreadable, moment(0)), UsageError);
  auto nowhere = kit_.options();
  nowhere.archive = folder_ / "nowhere";
  EXPECT_THROW(CaseWriter::create(files_, nowhere, moment(0)), UsageError);
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(CaseWriterTest, LeavesNothingBehindWhicheverCallOfItsCreationFails) {
  const auto whole = create();
  const std::size_t calls = files_.count();
  ASSERT_GE(calls, 25U);
  for (std::size_t at = 0; at < calls; ++at) {
    const TemporaryFolder folder(test::quick_parent());
    const test::CaseKit kit(folder.path());
    FaultFileSystem files(folder.path());
    files.fail("", EIO, at, 1);
    EXPECT_THROW(CaseWriter::create(files, kit.options(), moment(0)), Error) << files_.calls()[at];
    fs::remove(folder / ".reserve");
    EXPECT_TRUE(fs::is_empty(folder.path())) << files_.calls()[at];
  }
}

TEST_F(CaseWriterTest, ACaseWithoutItsFirstEntryNeverExists) {
  const auto whole = create();
  const std::size_t calls = files_.count();
  for (const bool power : {false, true}) {
    for (std::size_t at = 0; at < calls; ++at) {
      const TemporaryFolder folder(test::quick_parent());
      const test::CaseKit kit(folder.path());
      FaultFileSystem files(folder.path());
      files.kill_at(at);
      EXPECT_THROW(CaseWriter::create(files, kit.options(), moment(0)), test::Killed);
      if (power) {
        files.lose_power();
      }
      for (const fs::directory_entry& entry : fs::directory_iterator(folder.path())) {
        if (is_case_id(entry.path().filename().string())) {
          EXPECT_THAT(lies_of(entry.path(), kit), IsEmpty()) << files_.calls()[at];
        }
      }
    }
  }
}

TEST_F(CaseWriterTest, KeepsTheOrderOfDurability) {
  const auto writer = create();
  writer->append({ClockEntry{}}, moment(1));  // the ledger's blocks are allocated with its first line
  files_.forget_calls();
  writer->append({commit_segment(*writer, 0, "room", 0, "film")}, moment(2));
  const StoredCheckpoint checkpoint = writer->checkpoint(moment(3));
  writer->add_token(checkpoint, "swiss", bytes_of("response"), facts(), moment(4));
  const std::string id = writer->case_id();
  const std::string segment = id + "/segments/room/00000000.ts.age";
  const std::string note = id + "/checkpoints/00000003.note";
  const std::string token = id + "/tokens/00000003.swiss.tsr";
  const std::string ledger = id + "/ledger.jsonl";
  const auto bytes_of_line = [&](std::size_t seq) {
    return std::to_string(to_line(entries_of(writer->folder())[seq]).size() + 1);
  };
  std::vector<std::string> calls = files_.calls();
  // The age header leaves in pieces of its own; what counts is that nothing but writes of the part come
  // first.
  std::erase_if(calls,
                [&](const std::string& call) { return call.starts_with("write " + segment + ".part"); });
  EXPECT_THAT(
      calls,
      ElementsAre("create " + segment + ".part", "sync_all " + segment + ".part",
                  "rename " + segment + ".part " + segment, "sync_folder " + id + "/segments/room",
                  "write " + ledger + " " + bytes_of_line(2), "sync " + ledger, "create " + note + ".part",
                  "write " + note + ".part " + std::to_string(checkpoint.note.size()),
                  "sync_all " + note + ".part", "rename " + note + ".part " + note,
                  "sync_folder " + id + "/checkpoints", "create " + token + ".part",
                  "write " + token + ".part 8", "sync_all " + token + ".part",
                  "rename " + token + ".part " + token, "sync_folder " + id + "/tokens",
                  "write " + ledger + " " + bytes_of_line(3), "sync " + ledger));
}

TEST_F(CaseWriterTest, SeveralEntriesShareOneFlush) {
  const auto writer = create();
  const SegmentEntry first = commit_segment(*writer, 0, "room", 0, "a");
  const SegmentEntry second = commit_segment(*writer, 0, "room", 1, "b");
  files_.forget_calls();
  writer->append({first, second, ClockEntry{}}, moment(1));
  const std::vector<std::string> calls = files_.calls();
  EXPECT_EQ(std::count(calls.begin(), calls.end(), "sync " + writer->case_id() + "/ledger.jsonl"), 1);
  EXPECT_EQ(entries_of(writer->folder()).size(), 4U);
}

TEST_F(CaseWriterTest, TheCaseClockNeverGoesBack) {
  const auto writer = create();
  writer->append({ClockEntry{}}, moment(100));
  writer->append({ClockEntry{}}, moment(50));
  writer->append({ClockEntry{}}, moment(101));
  std::vector<std::int64_t> times;
  for (const CaseEntry& entry : entries_of(writer->folder())) {
    times.push_back(entry.at.mono_ns);
  }
  EXPECT_THAT(times, ElementsAre(0, 100, 100, 101));
}

TEST_F(CaseWriterTest, RefusesASegmentThatIsNotThereAsStated) {
  const auto writer = create();
  const SegmentEntry good = commit_segment(*writer, 0, "room", 0, "film");
  const auto refused = [&](SegmentEntry entry) {
    EXPECT_THROW(writer->append({ClockEntry{}, entry}, moment(1)), UsageError);
  };
  SegmentEntry other = good;
  other.file.bytes += 1;
  refused(other);
  other = good;
  other.stream = "endoscope";
  refused(other);
  other = good;
  other.index = 1;
  refused(other);
  other = good;
  other.complete = false;
  refused(other);
  other = good;
  other.file.file = "segments/room/../room/00000000.ts.age";
  refused(other);
  EXPECT_EQ(entries_of(writer->folder()).size(), 1U) << "nothing of a refused batch is written";
  writer->append({good}, moment(1));
  refused(good);  // once is enough
}

TEST_F(CaseWriterTest, RefusesSegmentsOutOfOrderAlsoWithinABatch) {
  const auto writer = create();
  const SegmentEntry zero = commit_segment(*writer, 0, "room", 0, "a");
  const SegmentEntry one = commit_segment(*writer, 0, "room", 1, "b");
  EXPECT_THROW(writer->append({one, zero}, moment(1)), UsageError);
  writer->append({one}, moment(1));
  EXPECT_THROW(writer->append({zero}, moment(2)), UsageError);
}

TEST_F(CaseWriterTest, NeverWritesASegmentOverAnother) {
  const auto writer = create();
  commit_segment(*writer, 0, "room", 0, "a");
  EXPECT_THROW(writer->begin_segment(0, 0), UsageError);
  EXPECT_THROW(writer->begin_segment(7, 0), std::out_of_range);
}

TEST_F(CaseWriterTest, RefusesEntriesThatHaveTheirOwnFunction) {
  const auto writer = create();
  EXPECT_THROW(writer->append({OpenEntry{}}, moment(1)), UsageError);
  EXPECT_THROW(writer->append({CloseEntry{}}, moment(1)), UsageError);
  EXPECT_THROW(writer->append({TokenEntry{}}, moment(1)), UsageError);
  EXPECT_THROW(writer->append({GapEntry{"nobody", {}, GapCause::kPaused}}, moment(1)), UsageError);
}

TEST_F(CaseWriterTest, ACheckpointIsTheSignedTree) {
  const auto writer = create();
  writer->append({ClockEntry{}}, moment(1));
  const StoredCheckpoint stored = writer->checkpoint(moment(2));
  EXPECT_EQ(stored.size, 2U);
  EXPECT_EQ(stored.file, writer->folder() / "checkpoints/00000002.note");
  EXPECT_EQ(contents(stored.file), stored.note);
  const auto note =
      crypto::open_note(stored.note, {crypto::VerifierKey("theatre-1", kit_.key().public_key())});
  EXPECT_FALSE(note.failure);
  EXPECT_EQ(note.text,
            (crypto::Checkpoint{"kiroku/theatre-1/" + writer->case_id(), 2, stored.root}).to_text());
  files_.forget_calls();
  EXPECT_EQ(writer->checkpoint(moment(3)).note, stored.note);
  EXPECT_THAT(files_.calls(), IsEmpty()) << "the tree has not grown";
}

TEST_F(CaseWriterTest, ATokenIsStoredAndEntered) {
  const auto writer = create();
  const StoredCheckpoint over = writer->checkpoint(moment(1));
  writer->add_token(over, "swiss", bytes_of("response"), facts(), moment(2));
  EXPECT_EQ(contents(writer->folder() / "tokens/00000001.swiss.tsr"), "response");
  const auto token = std::get<TokenEntry>(entries_of(writer->folder()).back().body);
  EXPECT_EQ(token.checkpoint, 1U);
  EXPECT_EQ(token.authority, "swiss");
  EXPECT_EQ(token.file, "tokens/00000001.swiss.tsr");
  EXPECT_EQ(token.sha256, crypto::sha256(bytes_of("response")));
  EXPECT_EQ(token.serial, "0a");
  EXPECT_THROW(writer->add_token(over, "swiss", bytes_of("again"), facts(), moment(3)), UsageError);
  // An evidence record begins with its version.
  const std::string record("\x30\x03\x02\x01\x01", 5);
  EXPECT_THROW(writer->add_token(over, "swiss", bytes_of(record), facts(), moment(3)), UsageError);
  writer->add_token(over, "other", bytes_of(record), facts(), moment(3));
  EXPECT_TRUE(fs::exists(writer->folder() / token_path(over.size, "other", TokenForm::kShared)));
  EXPECT_TRUE(writer->token_in_the_way(over.size, "other"));
  EXPECT_THROW(writer->add_token(over, "other", bytes_of("again"), facts(), moment(3)), UsageError);
  EXPECT_EQ(contents(writer->folder() / "tokens/00000001.swiss.tsr"), "response");
  EXPECT_THROW(writer->add_token(over, "../x", bytes_of("x"), facts(), moment(3)), UsageError);
}

TEST_F(CaseWriterTest, StoresAChainAsPem) {
  const auto writer = create();
  writer->store_authority_chain("swiss", {Bytes(50, std::byte{0}), Bytes(3, std::byte{1})});
  EXPECT_EQ(contents(writer->folder() / "authorities/swiss.pem"),
            "-----BEGIN CERTIFICATE-----\n" + std::string(64, 'A') +
                "\nAAA=\n-----END CERTIFICATE-----\n"
                "-----BEGIN CERTIFICATE-----\nAQEB\n-----END CERTIFICATE-----\n");
  EXPECT_THROW(writer->store_authority_chain("a/b", {}), UsageError);
}

TEST_F(CaseWriterTest, WritesAChainAnewOnlyWhereItIsAnother) {
  const auto writer = create();
  const std::vector<Bytes> one{Bytes(50, std::byte{0})}, other{Bytes(51, std::byte{0})};
  writer->store_authority_chain("swiss", one);
  files_.forget_calls();
  writer->store_authority_chain("swiss", one);
  EXPECT_THAT(files_.calls(), IsEmpty());
  writer->store_authority_chain("swiss", other);
  EXPECT_THAT(files_.calls(), Not(IsEmpty()));
  const std::string written = contents(writer->folder() / "authorities/swiss.pem");
  writer->store_authority_chain("swiss", one);
  EXPECT_NE(contents(writer->folder() / "authorities/swiss.pem"), written);
}

TEST_F(CaseWriterTest, AChainThatWasNotWrittenIsWrittenTheNextTime) {
  const auto writer = create();
  const std::vector<Bytes> chain{Bytes(50, std::byte{0})};
  files_.fail("rename", EIO, 0, 1);
  EXPECT_THROW(writer->store_authority_chain("swiss", chain), Error);
  EXPECT_FALSE(fs::exists(writer->folder() / "authorities/swiss.pem"));
  writer->store_authority_chain("swiss", chain);
  EXPECT_TRUE(fs::exists(writer->folder() / "authorities/swiss.pem"));
}

TEST_F(CaseWriterTest, CloseStatesTotalsOfEveryStream) {
  const auto writer = create();
  const SegmentEntry zero = commit_segment(*writer, 0, "room", 0, "a");
  const SegmentEntry one = commit_segment(*writer, 0, "room", 1, "b");
  writer->append({zero}, moment(1));
  writer->append({one}, moment(2));
  writer->close("operator", moment(3));
  const auto close = std::get<CloseEntry>(entries_of(writer->folder()).back().body);
  EXPECT_EQ(close.reason, "operator");
  ASSERT_EQ(close.totals.size(), 2U);
  EXPECT_EQ(close.totals.at("room").segments, 2U);
  EXPECT_EQ(close.totals.at("room").frames, 100U);
  EXPECT_EQ(close.totals.at("room").dropped, 1U);
  EXPECT_EQ(close.totals.at("room").bytes, zero.file.bytes + one.file.bytes);
  EXPECT_EQ(close.totals.at("vitals").segments, 0U);
}

TEST_F(CaseWriterTest, AfterCloseOnlyTimeStampsAreTaken) {
  const auto writer = create();
  EXPECT_THROW(writer->finish(moment(1)), UsageError) << "not closed";
  writer->close("operator", moment(1));
  EXPECT_THROW(writer->append({ClockEntry{}}, moment(2)), UsageError);
  EXPECT_THROW(writer->close("again", moment(2)), UsageError);
  writer->append({TokenMissedEntry{1, "swiss", "no answer"}}, moment(2));
  const StoredCheckpoint over = writer->checkpoint(moment(2));
  writer->add_token(over, "swiss", bytes_of("response"), facts(), moment(3));
  const StoredCheckpoint last = writer->finish(moment(4));
  EXPECT_EQ(last.size, 4U);
  EXPECT_EQ(entries_of(writer->folder()).size(), last.size) << "the last checkpoint covers everything";
  EXPECT_THROW(writer->checkpoint(moment(5)), UsageError);
  EXPECT_THROW(writer->finish(moment(5)), UsageError);
  EXPECT_THAT(lies_of(writer->folder(), kit_), IsEmpty());
}

TEST_F(CaseWriterTest, TellsTheApplianceLog) {
  const auto log = ApplianceLog::open(files_, folder_ / "log", kit_.key(), "theatre-1");
  log->boot("b1");
  auto options = kit_.options();
  options.log = log.get();
  const crypto::Sha256Digest root_before = log->root();
  const auto writer = CaseWriter::create(files_, options, moment(0));
  const auto open = std::get<OpenEntry>(entries_of(writer->folder())[0].body);
  EXPECT_EQ(open.appliance_log_size, 1U);
  EXPECT_EQ(open.appliance_log_root, root_before);
  const StoredCheckpoint first = writer->checkpoint(moment(1));
  writer->append({ClockEntry{}}, moment(59'000'000'000));
  writer->checkpoint(moment(59'000'000'000));  // not a minute yet
  writer->append({ClockEntry{}}, moment(60'000'000'001));
  const StoredCheckpoint minute = writer->checkpoint(moment(60'000'000'001));
  writer->append({ClockEntry{}}, moment(60'000'000'002));
  const StoredCheckpoint asked = writer->checkpoint(moment(60'000'000'002), true);
  writer->close("operator", moment(61'000'000'000));
  writer->add_token(writer->checkpoint(moment(61'000'000'000)), "swiss", bytes_of("response"), facts(),
                    moment(62'000'000'000));
  const StoredCheckpoint last = writer->finish(moment(63'000'000'000));

  const std::vector<LogLine> lines = read_log(folder_ / "log");
  std::vector<std::string> types;
  types.reserve(lines.size());
  for (const LogLine& line : lines) {
    types.push_back(line.type);
  }
  ASSERT_THAT(types, ElementsAre("boot", "case-opened", "case-checkpoint", "case-checkpoint",
                                 "case-checkpoint", "case-closed"));
  const std::string entry0 = to_line(entries_of(writer->folder())[0]);
  EXPECT_EQ(std::get<CaseOpenedEntry>(parse_log_entry(lines[1].json).entry->body).sha256,
            crypto::sha256(bytes_of(entry0)));
  EXPECT_EQ(std::get<CaseCheckpointEntry>(parse_log_entry(lines[2].json).entry->body).root, first.root);
  EXPECT_EQ(std::get<CaseCheckpointEntry>(parse_log_entry(lines[3].json).entry->body).root, minute.root);
  EXPECT_EQ(std::get<CaseCheckpointEntry>(parse_log_entry(lines[4].json).entry->body).root, asked.root);
  const auto closed = std::get<CaseClosedEntry>(parse_log_entry(lines[5].json).entry->body);
  EXPECT_EQ(closed.case_id, writer->case_id());
  EXPECT_EQ(closed.size, last.size);
  EXPECT_EQ(closed.root, last.root);
  EXPECT_EQ(closed.final_token, crypto::sha256(bytes_of("response")));
}

TEST_F(CaseWriterTest, KeepsASecondWriterOff) {
  const auto writer = create();
  try {
    Ledger::open(files_, writer->folder() / "ledger.jsonl", Ledger::Sharing::kExclusive, nullptr);
    FAIL() << "opened twice";
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("another process is writing"));
  }
}

TEST_F(CaseWriterTest, RefusesEverythingAfterAFailedFlushOfAnything) {
  for (const char* step : {"sync ", "sync_all ", "sync_folder "}) {
    const TemporaryFolder folder(test::quick_parent());
    const test::CaseKit kit(folder.path());
    FaultFileSystem files(folder.path());
    const auto writer = CaseWriter::create(files, kit.options(), moment(0));
    files.fail(step, EIO);
    EXPECT_THROW(
        {
          writer->append({ClockEntry{}}, moment(1));
          writer->checkpoint(moment(2));
        },
        SyncError)
        << step;
    files.heal();
    files.forget_calls();
    EXPECT_THROW(writer->append({ClockEntry{}}, moment(3)), Error) << step;
    EXPECT_THROW(writer->checkpoint(moment(3)), Error) << step;
    EXPECT_THROW(writer->close("operator", moment(3)), Error) << step;
    EXPECT_THAT(files.calls(), IsEmpty()) << step;
    EXPECT_THAT(lies_of(writer->folder(), kit), IsEmpty()) << step;
  }
}

TEST_F(CaseWriterTest, AFullDiskCostsTheReserveNotTheCase) {
  const auto writer = create();
  writer->append({ClockEntry{}}, moment(1));
  files_.fail("write", ENOSPC, 0, 1);
  writer->append({GapEntry{"room", {0, 1}, GapCause::kDiskFull}}, moment(2));
  EXPECT_EQ(fs::file_size(folder_ / ".reserve"), 7U << 20U);
  files_.fail("create", ENOSPC, 0, 2);
  writer->close("disk-full", moment(3));
  writer->finish(moment(3));
  EXPECT_THAT(lies_of(writer->folder(), kit_), IsEmpty());
  EXPECT_EQ(fs::file_size(folder_ / ".reserve"), 8U << 20U) << "filled up again, since there is room";
}

/// One short procedure with everything in it.
void record(FileSystem& files, const test::CaseKit& kit, ApplianceLog* log, const TokenEntry& facts) {
  auto options = kit.options();
  options.log = log;
  const auto writer = CaseWriter::create(files, options, moment(0));
  const StoredCheckpoint first = writer->checkpoint(moment(1));
  writer->append(
      {commit_segment(*writer, 0, "room", 0, "film"), commit_segment(*writer, 1, "vitals", 0, "{}\n")},
      moment(2));
  writer->add_token(first, "swiss", bytes_of("response"), facts, moment(3));
  writer->append({commit_segment(*writer, 0, "room", 1, "film")}, moment(4));
  writer->close("operator", moment(5));
  writer->add_token(writer->checkpoint(moment(6)), "swiss", bytes_of("response 2"), facts, moment(7));
  writer->finish(moment(8));
}

/// Cases in the folder whose ledger or notes claim what is not there.
std::vector<std::string> lies_in_archive(const fs::path& archive, const test::CaseKit& kit) {
  std::vector<std::string> lies;
  for (const fs::directory_entry& entry : fs::directory_iterator(archive)) {
    if (is_case_id(entry.path().filename().string())) {
      for (const std::string& lie : lies_of(entry.path(), kit)) {
        lies.push_back(lie);
      }
    }
  }
  return lies;
}

TEST_F(CaseWriterTest, WhereverItIsKilledTheDiskNeverLies) {
  record(files_, kit_, nullptr, facts());
  const std::vector<std::string> calls = files_.calls();
  for (const bool power : {false, true}) {
    for (std::size_t at = 0; at < calls.size(); ++at) {
      const TemporaryFolder folder(test::quick_parent());
      const test::CaseKit kit(folder.path());
      FaultFileSystem files(folder.path());
      files.kill_at(at);
      EXPECT_THROW(record(files, kit, nullptr, facts()), test::Killed);
      if (power) {
        files.lose_power();
      }
      EXPECT_THAT(lies_in_archive(folder.path(), kit), IsEmpty())
          << (power ? "power cut" : "kill") << " before call " << at << ": " << calls[at];
    }
  }
}

TEST_F(CaseWriterTest, WhicheverCallFailsTheDiskNeverLies) {
  record(files_, kit_, nullptr, facts());
  const std::vector<std::string> calls = files_.calls();
  for (const int error : {EIO, ENOSPC}) {
    for (std::size_t at = 0; at < calls.size(); ++at) {
      const TemporaryFolder folder(test::quick_parent());
      const test::CaseKit kit(folder.path());
      FaultFileSystem files(folder.path());
      files.fail("", error, at, 1);
      try {
        record(files, kit, nullptr, facts());
      } catch (const Error&) {  // NOLINT(bugprone-empty-catch): some calls matter, for some the reserve helps
      }
      EXPECT_THAT(lies_in_archive(folder.path(), kit), IsEmpty())
          << "error " << error << " at call " << at << ": " << calls[at];
    }
  }
}

}  // namespace
}  // namespace kiroku::archive
