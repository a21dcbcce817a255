// What stands in the appliance log behind the newest checkpoint of its device, and is not the device's: who
// can write to the archive's disk, and has no key, adds it. Nothing of it keeps anybody from recording.
#include <algorithm>
#include <cerrno>
#include <fstream>
#include <functional>
#include <iterator>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "archive/format/case_layout.h"
#include "archive/format/log_aside.h"
#include "archive/format/log_entry.h"
#include "archive/storage/space_reserve.h"
#include "archive/upkeep/holds.h"
#include "archive/verify/verifier.h"
#include "archive/writing/appliance_log.h"
#include "archive/writing/case_writer.h"
#include "archive/writing/ledger.h"
#include "archive/writing/log_reading.h"
#include "archive/writing/unsigned_lines.h"
#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "tests/support/case_kit.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::archive {
namespace {

namespace fs = std::filesystem;
using test::FaultFileSystem;
using test::TemporaryFolder;
using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
using testing::SizeIs;

constexpr const char* kCase = "20260805T091502Z-3f9c21ab";
constexpr std::int64_t kFarAhead = 8'000'000'000'000'000;
crypto::Sha256Digest some_hash() { return crypto::sha256(bytes_of("abc")); }

std::string text_of_file(const fs::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

class ForeignLines : public testing::Test {
 protected:
  [[nodiscard]] fs::path log_folder() const { return root() / "log"; }
  [[nodiscard]] fs::path ledger() const { return log_folder() / kLedgerFile; }
  [[nodiscard]] virtual fs::path root() const { return folder_.path(); }

  std::unique_ptr<ApplianceLog> open(FileSystem& files, const crypto::SigningKey& key,
                                     const std::optional<crypto::Checkpoint>& kept = {}) const {
    return ApplianceLog::open(files, log_folder(), key, "theatre-1", kept);
  }
  std::unique_ptr<ApplianceLog> open() const { return open(real_file_system(), key_); }

  [[nodiscard]] std::vector<std::string> types() const {
    std::vector<std::string> types;
    for_each_readable_log_line(log_folder(), [&](const LogLine& line) { types.push_back(line.type); });
    return types;
  }
  [[nodiscard]] LogEntry last() const {
    return parse_log_entry(read_log(log_folder()).back().json).entry.value();
  }
  /// A line as it would follow, of this body.
  [[nodiscard]] std::string next_line(const LogEntryBody& body) const {
    LogEntry entry = last();
    ++entry.seq;
    entry.body = body;
    return to_line(entry);
  }
  /// After two entries, in the first of them.
  void change_a_line_of(ApplianceLog& log) const {
    log.access("*", "unlocked", "sato");
    log.access("*", "locked", "sato");
    std::string text = text_of_file(ledger());
    text.replace(text.find("unlocked"), 8, "unlockeD");
    std::ofstream(ledger(), std::ios::binary) << text;
  }
  void add_text(const std::string& text) const { std::ofstream(ledger(), std::ios::app) << text; }
  void add(const LogEntryBody& body) const { add_text(next_line(body) + "\n"); }
  /// Zeros that take no room on the disk.
  void add_hole(std::uint64_t bytes) const { fs::resize_file(ledger(), fs::file_size(ledger()) + bytes); }
  /// A checkpoint over the lines as they are.
  void sign(const std::string& name, const crypto::SigningKey& key) const {
    crypto::MerkleFrontier tree;
    for (const LogLine& line : read_log(log_folder()))
      tree.append(crypto::merkle_leaf_hash(bytes_of(line.json)));
    const crypto::Checkpoint text{log_origin(name), tree.size(), tree.root()};
    std::ofstream(log_folder() / note_path(text.size), std::ios::binary)
        << crypto::sign_note(text.to_text(), name, key);
  }
  [[nodiscard]] crypto::Sha256Digest root_of_all() const {
    return root_of_log(log_folder(), read_log(log_folder()).size());
  }
  /// What lies beside the log.
  [[nodiscard]] std::vector<std::string> aside() const {
    std::vector<std::string> texts;
    for (const auto& folder : fs::directory_iterator(root())) {
      if (!is_log_aside_name(folder.path().filename().string()) ||
          !fs::is_directory(folder.symlink_status())) {
        continue;
      }
      for (const auto& file : fs::directory_iterator(folder)) {
        if (!file.is_regular_file()) continue;
        const std::string text = text_of_file(file.path());
        EXPECT_THAT(file.path().filename().string(),
                    testing::EndsWith("-" + crypto::to_hex(crypto::sha256(bytes_of(text))) + ".jsonl"));
        texts.push_back(text);
      }
    }
    return texts;
  }
  [[nodiscard]] VerificationReport verify() const {
    VerifyOptions options;
    options.devices = {device_};
    return verify_log(log_folder(), options);
  }
  [[nodiscard]] std::string codes() const {
    const VerificationReport report = verify();
    std::string codes(verdict_name(report.verdict));
    for (const Finding& each : report.findings) codes += " " + each.code;
    return codes;
  }
  [[nodiscard]] std::vector<std::string> deeds() const {
    EXPECT_NO_THROW(read_log(log_folder()));
    return deeds_of_readable();
  }
  [[nodiscard]] std::vector<std::string> deeds_of_readable() const {
    std::vector<std::string> deeds;
    for_each_readable_log_line(log_folder(), [&](const LogLine& line) {
      const LogEntryParse parsed = parse_log_entry(line.json);
      const auto* access = std::get_if<AccessEntry>(&parsed.entry->body);
      if (access != nullptr && access->who == "kiroku") deeds.push_back(access->what);
    });
    return deeds;
  }

  TemporaryFolder folder_{test::quick_parent()};
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  crypto::SigningKey stranger_ =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  crypto::VerifierKey device_{"theatre-1", key_.public_key()};
};

/// What somebody adds, by how many lines and signatures are there.
struct Forgery {
  std::string_view name;
  std::function<std::string(const std::function<std::string(LogEntryBody)>& line, const LogEntry& last)> text;
};

std::string changed(LogEntry entry, const std::function<void(LogEntry&)>& change) {
  ++entry.seq;
  entry.body = ConfigChangedEntry{some_hash()};
  change(entry);
  return to_line(entry) + "\n";
}

const crypto::VerifierKey& a_strangers_key() {
  static const crypto::SigningKey key =
      crypto::SigningKey::generate().with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  static const crypto::VerifierKey verifier = crypto::verifier_key_of("theatre-1", key);
  return verifier;
}

constexpr std::string_view kALongLine = "ALongLine";

/// No writer of this device leaves any of them.
const std::vector<Forgery>& forgeries() {
  const auto with = [](LogEntryBody body) {
    return [body](const auto& line, const LogEntry&) { return line(body); };
  };
  static const std::vector<Forgery> all{
      {"BootOfAnotherDevice", with(BootEntry{"b1", a_strangers_key().to_string()})},
      {"BootOfNoDevice", with(BootEntry{"b1", "theatre-1"})},
      {"BootWithAQuote",
       [](const auto& line, const LogEntry&) {
         BootEntry boot{"b1", "theatre-1"};
         boot.quote = StatedQuote{"AAAA", "AAAA", {"0:" + std::string(64, '0')}};
         return line(boot);
       }},
      {"KeyOfAnotherDevice", with(DeviceKeyChangedEntry{a_strangers_key().to_string()})},
      {"MlDsaKey", with(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()})},
      {"NoMlDsaKey", with(DeviceMlDsaEntry{"theatre-1"})},
      {"HardwareKey", with(DeviceHardwareEntry{"theatre-1+ecdsa"})},
      {"AttestationKey",
       with(DeviceAttestationEntry{"AAAA", {"AAAA", "AAAA", {"0:" + std::string(64, '0')}}})},
      {"SilenceOfNoHardware", with(DeviceHardwareSilentEntry{"it was taken away"})},
      {"Damage",
       [](const auto& line, const LogEntry& last) {
         return line(LogDamageEntry{last.seq + 1, some_hash(), some_hash()});
       }},
      {"DamageOfAnEnd",
       [](const auto& line, const LogEntry& last) {
         return line(LogDamageEntry{last.seq + 9, some_hash(), {}});
       }},
      {"Nonsense", [](const auto&, const LogEntry&) { return std::string("nonsense\n"); }},
      {"AnUnknownType",
       [](const auto&, const LogEntry& last) {
         return R"({"type":"praised","seq":)" + std::to_string(last.seq + 1) +
                R"(,"utc":"2026-08-05T10:00:00.000000Z","mono_ns":9})" + "\n";
       }},
      {"AnotherNumber",
       [](const auto&, const LogEntry& last) { return changed(last, [](LogEntry& entry) { ++entry.seq; }); }},
      {"AnEarlierMoment",
       [](const auto&, const LogEntry& last) {
         return changed(last, [](LogEntry& entry) { entry.at.mono_ns = 1; });
       }},
      {kALongLine,
       [](const auto&, const LogEntry&) { return std::string(kMaximumLineBytes + 300'000, 'x') + "\n"; }},
      {"BehindAStatement",
       [](const auto& line, const LogEntry&) { return line(ShutdownEntry{}) + "nonsense\n"; }},
  };
  return all;
}

class EachForgery : public ForeignLines, public testing::WithParamInterface<Forgery> {
 protected:
  [[nodiscard]] std::string forged() const {
    return GetParam().text([this](const LogEntryBody& body) { return next_line(body) + "\n"; }, last());
  }
};

/// Those behind which something can be written.
class EachThatIsLeft : public EachForgery {};

TEST_P(EachForgery, IsPutAsideAndTheLogIsSoundAndGoesOn) {
  const std::uint64_t hold = open()->case_held(kCase, "court order", "anna");
  const std::string before = text_of_file(ledger()), text = forged();
  add_text(text);
  const auto log = open();
  EXPECT_THAT(types(), ElementsAre("boot", "case-held", "recovered", "access")) << "at once";
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(before));
  EXPECT_EQ(log->damage(), "");
  EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("this device did not write")));
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "case-held", "recovered", "access", "access"));
  // What stands before it may be a crash's.
  const bool is_first = text.find("shutdown") == std::string::npos;
  EXPECT_THAT(deeds(), ElementsAre(testing::StartsWith("set aside what stood from entry " +
                                                       std::to_string(is_first ? hold + 1 : hold + 2))));
  EXPECT_THAT(aside(), Contains(is_first ? text : "nonsense\n"));
  EXPECT_THAT(aside(), SizeIs(is_first ? 1 : 2));
  EXPECT_EQ(codes(), "intact");
  EXPECT_THAT(open()->remarks(), IsEmpty());
}

TEST_P(EachForgery, IsPutAsideWhileTheLogIsOpen) {
  const auto log = open();
  log->boot("b1");
  log->config_changed(some_hash());
  log->access("*", "unlocked", "sato");
  std::vector<std::string> told;
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  add_text(forged());
  log->case_opened(kCase, some_hash());
  EXPECT_THAT(told, SizeIs(1));
  EXPECT_THAT(types(), ElementsAre("boot", "config-changed", "access", "recovered", "access", "case-opened"));
  log->tell_of_remarks({});
  log->case_closed(kCase, 9, some_hash(), {});
  EXPECT_THAT(codes(), Not(AnyOf(HasSubstr("tampered log-"), HasSubstr("entry-"), HasSubstr("late"))));
}

TEST_P(EachForgery, IsLostNowhereAndNeverSignedWhereverTheNextStartIsKilled) {
  for (const bool power : {false, true}) {
    bool through = false;
    for (std::size_t at = 0; !through; ++at) {
      fs::remove_all(log_folder());
      fs::remove_all(root() / kLogAsideFolder);
      open()->access("*", "unlocked", "sato");
      const std::string text = forged();
      add_text(text);
      FaultFileSystem files(root());
      files.kill_at(at);
      try {
        const auto log = open(files, key_);
        log->boot("b2");
        log->access("*", "locked", "sato");
        through = true;
      } catch (const test::Killed&) {
        if (power) files.lose_power();
      }
      open()->access("*", "unlocked", "mori");
      EXPECT_THAT(codes(), AnyOf("intact", "intact part-file")) << "kill at call " << at;
      bool is_whole = false;
      for (const std::string& kept : aside()) {
        if (kept.find("nonsense") == std::string::npos && kept != text) continue;
        is_whole = true;
        // Also where it was killed between cutting them off and entering that.
        const std::string sha256 = crypto::to_hex(crypto::sha256(bytes_of(kept)));
        EXPECT_THAT(deeds(), Contains(testing::EndsWith(", sha256 " + sha256))) << "kill at call " << at;
      }
      EXPECT_TRUE(is_whole) << "kill at call " << at;
      ASSERT_FALSE(HasFailure());
    }
  }
}

// What was changed and what was added are both left to whoever asks what happened.
TEST_P(EachThatIsLeft, IsLeftWhereLinesBeforeItWereChangedAndKeepsNobodyFromRecording) {
  open()->access("*", "unlocked", "sato");
  std::string text = text_of_file(ledger());
  text.replace(text.find("unlocked"), 8, "unlockeD");
  std::ofstream(ledger(), std::ios::binary) << text;
  add_text(forged());
  text = text_of_file(ledger());
  for (int i = 0; i < 3; ++i) {
    const auto log = open();
    EXPECT_THAT(log->damage(), testing::StartsWith(i == 0 ? "the appliance log" : ""));
    log->access("*", "unlocked", "sato");
    EXPECT_THAT(log->stated_keys().ml_dsa, std::nullopt);
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(types(), Contains("damage-found"));
  EXPECT_THAT(text_of_file(ledger()), HasSubstr("found no signature of this device over entries "));
  EXPECT_THAT(codes(), AnyOf(HasSubstr("log-damage-stated"), HasSubstr("checkpoint-root-differs")));
}

// Else the changed lines would be signed with what says that the added one was put aside.
TEST_P(EachThatIsLeft, IsLeftWhereLinesBeforeItAreChangedWhileTheLogIsOpen) {
  const auto log = open();
  change_a_line_of(*log);
  add_text(forged());
  const std::string text = text_of_file(ledger());
  log->access("*", "unlocked", "mori");
  log->access("*", "locked", "mori");
  EXPECT_THAT(log->remarks(), Contains(HasSubstr("were changed while it was open")));
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(types(), Contains("damage-found"));
  EXPECT_THAT(aside(), IsEmpty());
  EXPECT_THAT(codes(), AnyOf(HasSubstr("log-damage-stated"), HasSubstr("checkpoint-root-differs")));
  EXPECT_EQ(open()->damage(), "") << "it is stated";
}

// What this object signs then goes on from the lines that the other one signed.
TEST_F(ForeignLines, ThatAnotherProgramFoundChangedAreReadAnewByThisOne) {
  const auto log = open();
  change_a_line_of(*log);
  open()->access("*", "unlocked", "mori");
  log->access("*", "locked", "mori");
  EXPECT_EQ(open()->damage(), "") << "the newest checkpoint fits";
  EXPECT_EQ(std::ranges::count(types(), "damage-found"), 1);
  EXPECT_THAT(codes(), HasSubstr("log-damage-stated"));
}

TEST_F(ForeignLines, AreToldOnceToWhoeverListensLater) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  add_text("nonsense\n");
  log->access("*", "locked", "sato");
  std::vector<std::string> told;
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  log->tell_of_remarks({});
  log->tell_of_remarks([&](const std::string& remark) { told.push_back(remark); });
  EXPECT_THAT(told, ElementsAre(HasSubstr("this device did not write")));
}

TEST_P(EachThatIsLeft, OnADiskWithoutRoomIsLeftAndNamedAndKeepsNobodyFromRecording) {
  open()->access("*", "unlocked", "sato");
  add_text(forged());
  const std::string text = text_of_file(ledger());
  FaultFileSystem files(root());
  files.fail("create log-aside", ENOSPC);
  {
    const auto log = open(files, key_);
    log->access("*", "unlocked", "sato");
    EXPECT_THAT(log->remarks(), Contains(HasSubstr("cannot be put aside")));
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(text_of_file(ledger()), HasSubstr("found no signature of this device over entries "));
  // Covered by a checkpoint of the device now; what it states counts for nothing all the same.
  for (int i = 0; i < 3; ++i) open()->access("*", "unlocked", "sato");
  EXPECT_EQ(open()->stated_keys().ml_dsa, std::nullopt);
}

INSTANTIATE_TEST_SUITE_P(Of, EachForgery, testing::ValuesIn(forgeries()),
                         [](const auto& each) { return std::string(each.param.name); });

INSTANTIATE_TEST_SUITE_P(Of, EachThatIsLeft, testing::ValuesIn([] {
                           std::vector<Forgery> all = forgeries();
                           std::erase_if(all, [](const Forgery& each) { return each.name == kALongLine; });
                           return all;
                         }()),
                         [](const auto& each) { return std::string(each.param.name); });

TEST_F(ForeignLines, ALongLineOnADiskWithoutRoomIsCutOffAllTheSame) {
  FaultFileSystem files(root());
  const auto running = open(files, key_);
  running->access("*", "unlocked", "sato");
  for (const bool at_a_start : {false, true}) {
    add_text(std::string(kMaximumLineBytes + 300'000, 'x') + "\n");
    files.fail("create log-aside", ENOSPC);
    const auto started = at_a_start ? open(files, key_) : nullptr;
    ApplianceLog& log = started ? *started : *running;
    log.access("*", "unlocked", "sato");
    files.heal();
    EXPECT_EQ(codes(), "intact");
    EXPECT_THAT(log.remarks(), Contains(HasSubstr("cut off all the same")));
  }
}

TEST_F(ForeignLines, WithAZeroByteArePutAsideWhileTheLogIsOpen) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  for (const std::string& before :
       {std::string(), std::string("nonsense\n"), next_line(ShutdownEntry{}) + "\n"}) {
    const std::string sound = text_of_file(ledger());
    const std::string text = std::string("{\"a\":\"\0\"}\n", 10) + next_line(ShutdownEntry{}) + "\n";
    add_text(before + text);
    log->access("*", "locked", "sato");
    EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(sound));
    EXPECT_THAT(aside(), Contains(text));
    EXPECT_EQ(codes(), "intact") << before;
  }
}

// No reader gets beyond so many zeros: nobody would look at what stands behind them before it is signed.
TEST_F(ForeignLines, BehindMoreZerosThanAreReadCountForNothing) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  const std::string key = next_line(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()}) + "\n";
  const std::uint64_t before = fs::file_size(ledger());
  for (std::uint64_t bytes = 0; bytes <= kMostBytesOfLine + kMaximumLineBytes; bytes += kMaximumLineBytes) {
    add_hole(kMaximumLineBytes - 1);
    add_text("\n");
  }
  add_text(key);
  const std::uint64_t stood = fs::file_size(ledger()) - before;
  log->access("*", "locked", "sato");
  log->checkpoint();
  EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt);
  EXPECT_THAT(types(), ElementsAre("boot", "access", "recovered", "access", "access"));
  EXPECT_THAT(deeds(), ElementsAre(HasSubstr(" of the " + std::to_string(stood) +
                                             " bytes that stood from entry 2 on")));
  EXPECT_THAT(aside(), ElementsAre(AllOf(HasSubstr(key), testing::SizeIs(testing::Lt(kMostBytesAside)))));
  EXPECT_EQ(codes(), "intact");
  open()->access("*", "unlocked", "mori");
  EXPECT_EQ(codes(), "intact");
}

// Whoever makes the log longer than any disk has room for fills none by it.
TEST_F(ForeignLines, ThatTakeNoRoomAreNotCopied) {
  const auto log = open();
  log->access("*", "unlocked", "sato");
  // The format has no number as large as the last one; not every file system has such files.
  for (const unsigned power : {40U, 60U}) {
    std::error_code too_large;
    fs::resize_file(ledger(), std::uint64_t{1} << power, too_large);
    if (too_large) continue;
    log->access("*", "locked", "sato");
    EXPECT_EQ(codes(), "intact");
    for (const std::string& kept : aside()) EXPECT_LT(kept.size(), std::size_t{1} << 16U);
    EXPECT_THAT(log->remarks(), Contains(HasSubstr("bytes, without holes, lie in ")));
  }
  EXPECT_THAT(deeds(), Contains(testing::StartsWith("set aside ")));
}

TEST_F(ForeignLines, OfWhichThereAreManyAreKeptInPart) {
  open()->access("*", "unlocked", "sato");
  const std::string line = std::string(900'000, 'x') + "\n";
  std::string text;
  while (text.size() <= kMostBytesAside) text += line;
  add_text(text);
  open()->access("*", "locked", "sato");
  EXPECT_THAT(deeds(),
              ElementsAre(testing::StartsWith("set aside 16777216 of the " + std::to_string(text.size()) +
                                              " bytes that stood from entry 2 on, which this device did "
                                              "not sign, sha256 ")));
  EXPECT_THAT(aside(), ElementsAre(text.substr(0, kMostBytesAside)));
  EXPECT_EQ(codes(), "intact");
}

/// The real one, that does something before a file is opened.
class HookedFiles final : public FileSystem {
 public:
  /// What errno is to be instead of an opened file; 0: it is opened.
  std::function<int(const fs::path& path)> hook;

  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    const int error = hook ? hook(path) : 0;
    if (error == 0) return FileReading::open_at(folder, name, flags, path);
    errno = error;
    return -1;
  }
  std::unique_ptr<WritableFile> create(const fs::path& file) override { return real_.create(file); }
  std::unique_ptr<WritableFile> append_to(const fs::path& file) override { return real_.append_to(file); }
  void rename(const fs::path& from, const fs::path& to) override { real_.rename(from, to); }
  void remove(const fs::path& file) override { real_.remove(file); }
  void make_folder(const fs::path& folder) override { real_.make_folder(folder); }
  void sync_folder(const fs::path& folder) override { real_.sync_folder(folder); }

 private:
  FileSystem& real_ = real_file_system();
};

// Whoever does not ask for the turn writes between the look at a line and the next signature.
TEST_F(ForeignLines, AddedWhileOthersAreLookedAtAreNotSignedEither) {
  const std::string key = a_strangers_key().ml_dsa()->to_string();
  HookedFiles files;
  const auto log = open(files, key_);
  log->access("*", "unlocked", "sato");
  for (int times = 1; times <= 8; ++times) {
    int left = times;
    const std::string line = next_line(DeviceMlDsaEntry{key}) + "\n";
    files.hook = [&](const fs::path& path) {
      if (path == ledger() && left-- > 0) add_text(line);
      return 0;
    };
    log->access("*", "locked", "sato");
    EXPECT_EQ(codes(), "intact") << times;
  }
  // Or for ever.
  const std::string line = next_line(DeviceMlDsaEntry{key}) + "\n";
  files.hook = [&](const fs::path& path) {
    if (path == ledger()) add_text(line);
    return 0;
  };
  EXPECT_THROW(log->access("*", "unlocked", "mori"), LedgerHeldError);
  files.hook = nullptr;
  log->access("*", "locked", "mori");
  EXPECT_EQ(codes(), "intact");
  EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt);
}

// Nor does stating each of them end never, where the next one comes meanwhile.
TEST_F(ForeignLines, AddedWhileOthersAreStatedWaitForTheNextEntry) {
  HookedFiles files;
  const auto log = open(files, key_);
  log->access("*", "unlocked", "sato");
  add_text("first\n");
  int added = 0;
  files.hook = [&](const fs::path& path) {
    if (path.extension() == ".note" && added < 10'000) add_text("line " + std::to_string(++added) + "\n");
    return 0;
  };
  for (int times = 0; times < 2; ++times) {
    try {
      log->access("*", "locked", "sato");
    } catch (const LedgerHeldError&) {  // NOLINT(bugprone-empty-catch): a running case survives it
    }
  }
  EXPECT_GT(added, 0);
  EXPECT_LT(added, 10'000);
  files.hook = nullptr;
  log->access("*", "locked", "mori");
  EXPECT_EQ(codes(), "intact");
}

/// What a writer of this device that dies leaves as well: one line that has no checkpoint.
class EachStatement : public ForeignLines, public testing::WithParamInterface<LogEntryBody> {};

TEST_P(EachStatement, IsTakenBackAndKeptBesideTheLog) {
  open()->case_opened(kCase, some_hash());
  for (const bool with_a_boot_behind_it : {false, true}) {
    for (const char* in_its_place : {"", "x"}) {
      const std::string before = text_of_file(ledger());
      add(GetParam());
      if (*in_its_place != '\0') std::ofstream(log_folder() / note_path(last().seq + 1)) << in_its_place;
      if (with_a_boot_behind_it) add(BootEntry{"b1", device_.to_string()});
      const std::string text = text_of_file(ledger()).substr(before.size());
      const auto log = open();
      EXPECT_EQ(text_of_file(ledger()), before);
      EXPECT_THAT(log->remarks(), IsEmpty()) << "a crash does that";
      EXPECT_THAT(aside(), Contains(text));
      log->access("*", "unlocked", "sato");
      EXPECT_THAT(codes(), Not(HasSubstr("late")));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Of, EachStatement,
    testing::Values(
        LogEntryBody(ShutdownEntry{}), LogEntryBody(PlanSealedEntry{some_hash()}),
        LogEntryBody(CaseCheckpointEntry{kCase, 900, some_hash()}),
        LogEntryBody(CaseClosedEntry{kCase, 900, some_hash(), {}}),
        LogEntryBody(ReplicatedEntry{kCase, "s3"}), LogEntryBody(CaseErasedEntry{kCase, {}, "p"}),
        LogEntryBody(AccessEntry{"*", "unlocked", "sato", {}}),
        LogEntryBody(AccessEntry{"*", "found no signature of this device over entries 0 to 1", "kiroku", {}}),
        LogEntryBody(PreRollDiscardedEntry{1, {}}), LogEntryBody(CaseHeldEntry{kCase, "court order", "anna"}),
        LogEntryBody(CaseReleasedEntry{kCase, 1, "over", "anna"})));

/// What somebody puts where lines are put aside.
struct InTheWay {
  std::string_view name;
  std::function<void(const fs::path& place)> put;
};

class EachThingInTheWay : public ForeignLines, public testing::WithParamInterface<InTheWay> {};

TEST_P(EachThingInTheWay, KeepsNoForeignLineInTheLog) {
  open()->access("*", "unlocked", "sato");
  fs::create_directory(root() / "elsewhere");
  std::size_t before = 0;
  for (const auto& names :
       {std::vector<std::string>{"log-aside"},
        std::vector<std::string>{"log-aside", "log-aside-2", "log-aside-3", "log-aside-4", "log-aside-5"}}) {
    for (const std::string& name : names) {
      fs::remove_all(root() / name);
      GetParam().put(root() / name);
    }
    add_text("nonsense\n");
    const auto log = open();
    EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("this device did not write")));
    log->access("*", "unlocked", "sato");
    EXPECT_EQ(codes(), "intact");
    EXPECT_THAT(text_of_file(ledger()), Not(HasSubstr("nonsense")));
    EXPECT_THAT(aside(), ElementsAre("nonsense\n"));
    EXPECT_THAT(deeds(), SizeIs(++before));
  }
  EXPECT_TRUE(fs::is_empty(root() / "elsewhere")) << "nothing is written over a link";
}

INSTANTIATE_TEST_SUITE_P(
    Of, EachThingInTheWay,
    testing::Values(InTheWay{"File", [](const fs::path& place) { std::ofstream(place) << "in the way"; }},
                    InTheWay{"Link",
                             [](const fs::path& place) {
                               fs::create_directory_symlink(place.parent_path() / "elsewhere", place);
                             }},
                    InTheWay{"FolderInTheFilesPlace",
                             [](const fs::path& place) {
                               for (std::uint64_t line = 0; line < 32; ++line)
                                 fs::create_directories(place / (format_index(line) + ".part") / "x");
                             }}),
    [](const auto& each) { return std::string(each.param.name); });

// Whoever fills the disk, too, has no more of it: the recorder keeps room back.
TEST_F(ForeignLines, OnAFullDiskArePutAsideIntoTheRoomThatIsKeptBack) {
  open()->access("*", "unlocked", "sato");
  SpaceReserve(real_file_system(), reserve_file(root())).fill();
  const std::uintmax_t reserve = fs::file_size(reserve_file(root()));
  for (const bool is_long : {false, true}) {
    add_text(is_long ? std::string(300, 'x') + "\n" : "nonsense\n");
    for (int lines = 0; is_long && lines < 1000; ++lines) add_text(std::string(300, 'x') + "\n");
    FaultFileSystem files(root());
    files.fail("create log-aside", ENOSPC, 0, 1);
    const auto log = open(files, key_);
    EXPECT_EQ(text_of_file(ledger()).find("xxx") != std::string::npos, is_long) << "a long one is left";
    EXPECT_THAT(text_of_file(ledger()), Not(HasSubstr("nonsense")));
    EXPECT_EQ(fs::file_size(reserve_file(root())), reserve - SpaceReserve::kStep);
  }
}

// Somebody may make such files: the log does not say that lines stood there.
TEST_F(ForeignLines, AFileThatNoEntryTellsOfIsToldOnceAndAsNoMoreThanThat) {
  open()->access("*", "unlocked", "sato");
  fs::create_directory(root() / kLogAsideFolder);
  for (int i = 0; i < 40; ++i) {
    const std::string text = std::to_string(i);
    const std::string sha256 = crypto::to_hex(crypto::sha256(bytes_of(text)));
    std::ofstream(root() / kLogAsideFolder / ("00000007-" + sha256 + ".jsonl.untold")) << text;
  }
  std::ofstream(root() / kLogAsideFolder / "00000007-abc.jsonl.untold") << "no such name";
  std::ofstream(root() / kLogAsideFolder / "x.untold") << "no such name";
  for (const std::size_t told : {16U, 32U, 40U, 40U}) {
    open();
    EXPECT_THAT(deeds(), SizeIs(told)) << "few at a time";
    EXPECT_THAT(deeds(), testing::Each(testing::StartsWith(
                             "found beside the log what was set aside from entry 7 on, of which no entry")));
    EXPECT_EQ(codes(), "intact");
  }
}

// What somebody put in the way of their names is there at each start.
TEST_F(ForeignLines, FilesThatCannotGetTheirNameHideNoneBehindThem) {
  open()->access("*", "unlocked", "sato");
  const auto put = [&](const std::string& number, const std::string& text) {
    const std::string name = number + "-" + crypto::to_hex(crypto::sha256(bytes_of(text))) + ".jsonl";
    std::ofstream(root() / kLogAsideFolder / (name + ".untold")) << text;
    return root() / kLogAsideFolder / name;
  };
  fs::create_directory(root() / kLogAsideFolder);
  for (int i = 0; i < 16; ++i) fs::create_directories(put("00000001", std::to_string(i)) / "x");
  const fs::path real = put("00000007", "nonsense\n");
  for (const std::size_t told : {16U, 17U, 17U}) {
    open();
    EXPECT_THAT(deeds(), SizeIs(told));
  }
  EXPECT_EQ(text_of_file(real), "nonsense\n");
  for (const auto& file : fs::directory_iterator(root() / kLogAsideFolder))
    EXPECT_THAT(file.path().string(), Not(testing::EndsWith(".untold")))
        << "each start would read the log for it";
}

TEST_F(ForeignLines, AFileOfWhichAnEntryTellsGetsItsNameAlone) {
  open()->access("*", "unlocked", "sato");
  add_text("nonsense\n");
  FaultFileSystem files(root());
  files.fail("rename log-aside/00000002-" + crypto::to_hex(crypto::sha256(bytes_of("nonsense\n"))), EIO);
  open(files, key_);
  const std::vector<std::string> said = deeds();
  EXPECT_THAT(said, ElementsAre(testing::StartsWith("set aside what stood from entry 2 on")));
  EXPECT_THAT(open()->remarks(), IsEmpty());
  EXPECT_EQ(deeds(), said);
  EXPECT_THAT(aside(), ElementsAre("nonsense\n"));
}

TEST_F(ForeignLines, WhatComesWithTheNextEntryStays) {
  open()->access("*", "unlocked", "sato");
  add(BootEntry{"b1", device_.to_string()});
  add(LogRecoveredEntry{9});
  add(ConfigChangedEntry{some_hash()});
  const std::string text = text_of_file(ledger());
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(log->remarks(), IsEmpty());
  EXPECT_EQ(codes(), "intact");
}

// The clock of later lines would go back.
TEST_F(ForeignLines, ALaterMomentOfThisBootIsFollowedByABoot) {
  open()->access("*", "unlocked", "sato");
  add_text(changed(last(), [](LogEntry& entry) { entry.at.mono_ns = kFarAhead; }));
  open()->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "access", "config-changed", "boot", "access"));
  EXPECT_EQ(codes(), "intact");
}

TEST_F(ForeignLines, SeveralThatLackTheirCheckpointStayAndTheLogSaysSo) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  fs::remove(log_folder() / note_path(4));
  fs::remove(log_folder() / note_path(5));
  const std::string text = text_of_file(ledger());
  const auto log = open();
  EXPECT_EQ(log->size(), 5U);
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 3 to 4"));
  EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("from 3 to 4")));
  EXPECT_THAT(open()->remarks(), IsEmpty()) << "once";
}

// The home keeps the newest checkpoint: without its note in the archive the lines are the device's all the
// same.
TEST_F(ForeignLines, WhatACheckpointThatWasKeptElsewhereCoversIsTheDevices) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  const crypto::Checkpoint kept{log_origin("theatre-1"), 5, root_of_all()};
  fs::remove(log_folder() / note_path(4));
  fs::remove(log_folder() / note_path(5));
  const std::string text = text_of_file(ledger());
  add_text("nonsense\n");
  const auto log = open(real_file_system(), key_, kept);
  EXPECT_EQ(log->lacks(), "");
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre(HasSubstr("from entry 5 on")));
}

// Whoever has a copy of the log and a key of their own carries it on.
TEST_F(ForeignLines, UnderAnotherKeyArePutAsideWithTheirCheckpoints) {
  open()->case_opened(kCase, some_hash());
  const std::string before = text_of_file(ledger());
  for (const LogEntryBody& body : {LogEntryBody(DeviceKeyChangedEntry{
                                       crypto::VerifierKey("stranger", stranger_.public_key()).to_string()}),
                                   LogEntryBody(CaseClosedEntry{kCase, 900, some_hash(), {}})}) {
    add(body);
    sign("stranger", stranger_);
  }
  add(BootEntry{"b1", device_.to_string()});
  const auto log = open();
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(before));
  EXPECT_EQ(log->case_state(kCase), ApplianceLog::CaseState::kOpened);
  log->case_closed(kCase, 9, some_hash(), {});
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "recovered", "access", "case-closed"));
  EXPECT_THAT(codes(), Not(HasSubstr("device-not-trusted")));
  EXPECT_THAT(aside(), ElementsAre(HasSubstr("stranger+")));
}

// Checkpoints of theirs, above what is left, hide nothing of what the device entered.
TEST_F(ForeignLines, ThatWerePutAsideHideNoHoldByTheirCheckpoints) {
  open()->case_held(kCase, "court order", "anna");
  for (int i = 0; i < 3; ++i) {
    add(DeviceKeyChangedEntry{crypto::VerifierKey("stranger", stranger_.public_key()).to_string()});
    sign(i == 1 ? "theatre-1" : "stranger", stranger_);
  }
  std::ofstream(log_folder() / note_path(99)) << "nothing";
  const auto log = open();
  const Holds holds = read_holds(log_folder(), device_);
  EXPECT_THAT(why_held(holds, kCase), HasSubstr("court order"));
  // One of the device's own says that lines are gone.
  for (int i = 0; i < 3; ++i) log->access("*", "unlocked", "sato");
  const std::string text = text_of_file(ledger());
  std::ofstream(ledger(), std::ios::binary) << text.substr(0, text.rfind('\n', text.size() - 2) + 1);
  EXPECT_THAT([&] { read_holds(log_folder(), device_); },
              testing::ThrowsMessage<Error>(HasSubstr("where one was signed over")));
}

/// What a home's processes share.
struct SharedMemory {
  std::optional<std::string> note;

  LogMemory of_one() {
    return {[this] { return note; }, [this](std::string_view text) { note = std::string(text); }};
  }
};

class TwoProcesses : public ForeignLines {
 protected:
  std::unique_ptr<ApplianceLog> open_one() {
    return ApplianceLog::open(real_file_system(), log_folder(), key_, "theatre-1", {}, shared_.of_one());
  }
  void take_newest_checkpoint_away() const { fs::remove(log_folder() / note_path(last().seq + 1)); }

  SharedMemory shared_;
};

// The line would be lost, and the recorder would find that lines which it entered are gone.
TEST_F(TwoProcesses, CutOffNothingThatTheOtherOneSigned) {
  const auto recorder = open_one();
  const auto viewer = open_one();
  viewer->access("*", "unlocked", "sato");
  for (const bool is_opened_now : {false, true}) {
    for (const std::string& added : {std::string(), std::string("nonsense\n")}) {
      const std::uint64_t hold = recorder->case_held(kCase, "court order", "anna");
      const std::string text = text_of_file(ledger());
      take_newest_checkpoint_away();
      add_text(added);
      const auto another = is_opened_now ? open_one() : nullptr;
      (another ? *another : *viewer).access("*", "watched", "mori");
      EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
      EXPECT_TRUE(fs::exists(log_folder() / note_path(hold + 1))) << "it is put back";
      EXPECT_THAT((another ? *another : *viewer).remarks(), Contains(HasSubstr("somebody took it away")));
      recorder->access("*", "unlocked", "sato");
    }
  }
  EXPECT_EQ(codes(), "intact");
}

// A power cut leaves zeros, too, but not where a line was that was flushed before it was signed.
TEST_F(TwoProcesses, CutNothingOffThatIsSignedThoughItHoldsZerosNow) {
  open_one()->case_held(kCase, "court order", "anna");
  take_newest_checkpoint_away();
  std::string text = text_of_file(ledger());
  text.replace(text.find("court order"), 11, 11, '\0');
  std::ofstream(ledger(), std::ios::binary) << text;
  const auto log = open_one();
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
}

TEST_F(TwoProcesses, TakeBackWhatNeitherSigned) {
  const auto recorder = open_one();
  recorder->access("*", "unlocked", "sato");
  const std::string before = text_of_file(ledger());
  // Nor does what is remembered count where it is of other lines, or anybody's.
  const auto remembered = [&](const std::string& name, const crypto::SigningKey& key) {
    const crypto::Checkpoint text{log_origin("theatre-1"), last().seq + 1, root_of_all()};
    return crypto::sign_note(text.to_text(), name, key);
  };
  for (int which = 0; which < 4; ++which) {
    add(CaseHeldEntry{kCase, "made up", "nobody"});
    if (which == 0) shared_.note = remembered("theatre-1", stranger_);
    if (which == 1) shared_.note = "nonsense";
    if (which == 2) shared_.note.reset();
    if (which == 3) {
      const crypto::Checkpoint other{log_origin("theatre-1"), last().seq + 1, some_hash()};
      shared_.note = crypto::sign_note(other.to_text(), "theatre-1", key_);
    }
    open_one();
    EXPECT_EQ(text_of_file(ledger()), before) << which;
  }
}

/// Lines that the device signed, and that somebody changed on the disk into what no reader gets beyond.
struct Unreadable {
  std::string_view name;
  std::function<void(const fs::path& file, std::uint64_t begin, std::uint64_t end)> make;  // of bytes
};

void put_in_place(const fs::path& file, std::uint64_t begin, std::uint64_t end, const std::string& what) {
  const std::string text = text_of_file(file);
  std::ofstream(file, std::ios::binary) << text.substr(0, begin) << what << text.substr(end);
}

void put_hole_in_place(const fs::path& file, std::uint64_t begin, std::uint64_t end, std::uint64_t bytes) {
  const std::string text = text_of_file(file);
  std::ofstream(file, std::ios::binary) << text.substr(0, begin);
  fs::resize_file(file, begin + bytes);
  std::ofstream(file, std::ios::binary | std::ios::app) << text.substr(end);
}

class EachUnreadableLine : public TwoProcesses, public testing::WithParamInterface<Unreadable> {
 protected:
  /// The second of five lines.
  void make_unreadable() const {
    const std::string text = text_of_file(ledger());
    const std::size_t begin = text.find('\n') + 1;
    GetParam().make(ledger(), begin, text.find('\n', begin));
  }
  void take_checkpoints_away() const { fs::remove_all(log_folder() / kCheckpointsFolder); }
  /// What stands behind the line.
  [[nodiscard]] std::string behind() const {
    const std::string text = text_of_file(ledger());
    return text.substr(text.find('\n', text.find('\n') + 1) + 1);
  }
};

TEST_P(EachUnreadableLine, KeepsNobodyFromRecordingAndNothingThatIsSignedIsLost) {
  for (const bool at_a_start : {true, false}) {
    for (const bool without_checkpoints : {false, true}) {
      fs::remove_all(log_folder());
      fs::remove_all(root() / kLogAsideFolder);
      shared_.note.reset();
      auto log = open_one();
      for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
      const std::string signed_behind = behind();
      make_unreadable();
      if (without_checkpoints) take_checkpoints_away();
      if (at_a_start) log = open_one();
      log->case_opened(kCase, some_hash());
      log->case_closed(kCase, 9, some_hash(), {});
      EXPECT_THAT(behind(), testing::StartsWith(signed_behind));
      EXPECT_THAT(text_of_file(ledger()), HasSubstr("\nset aside: a line of "));
      EXPECT_THAT(types(), AllOf(Contains("case-opened"), Contains("case-closed")));
      EXPECT_THAT(deeds_of_readable(),
                  Contains(testing::StartsWith(
                      "set aside what stood in lines from entry 1 on that this device had signed")));
      EXPECT_THAT(aside(), SizeIs(1));
      // Without the checkpoints nobody knows what the lines were, but the home, which the entry tells of.
      if (!without_checkpoints) {
        EXPECT_THAT(types(), Contains("damage-found"));
      }
      EXPECT_THAT(log->remarks(), Contains(HasSubstr("which this device had signed, became longer")));
      EXPECT_THAT(codes(), AllOf(testing::StartsWith("tampered"), Not(HasSubstr("too-long"))));
      EXPECT_THAT(codes(), Not(HasSubstr("log-tail-unsigned"))) << "what is entered is signed";
      const std::string text = text_of_file(ledger());
      open_one()->access("*", "unlocked", "sato");
      EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text)) << "once";
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Of, EachUnreadableLine,
    testing::Values(Unreadable{"JustTooLong",
                               [](const fs::path& file, std::uint64_t begin, std::uint64_t end) {
                                 put_in_place(file, begin, end, std::string(kMaximumLineBytes + 1, 'x'));
                               }},
                    Unreadable{"Long",
                               [](const fs::path& file, std::uint64_t begin, std::uint64_t end) {
                                 put_in_place(file, begin, end, std::string(3 * kMaximumLineBytes, 'x'));
                               }},
                    Unreadable{"Hole",
                               [](const fs::path& file, std::uint64_t begin, std::uint64_t end) {
                                 put_hole_in_place(file, begin, end, std::uint64_t{1} << 38U);
                               }}),
    [](const auto& each) { return std::string(each.param.name); });

TEST_F(ForeignLines, NoSignedLineBehindAnUnreadableOneIsLostWhereverTheNextStartIsKilled) {
  for (const bool power : {false, true}) {
    bool through = false;
    for (std::size_t at = 0; !through; ++at) {
      fs::remove_all(log_folder());
      fs::remove_all(root() / kLogAsideFolder);
      {
        const auto log = open();
        for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
      }
      const std::string text = text_of_file(ledger());
      const std::size_t begin = text.find('\n') + 1, end = text.find('\n', begin);
      const std::string signed_behind = text.substr(end + 1);
      put_hole_in_place(ledger(), begin, end, std::uint64_t{1} << 38U);
      FaultFileSystem files(root());
      files.kill_at(at);
      try {
        open(files, key_)->access("*", "locked", "sato");
        through = true;
      } catch (const test::Killed&) {
        if (power) files.lose_power();
      }
      open()->access("*", "unlocked", "mori");
      std::vector<std::string> all{text_of_file(ledger())};
      for (const auto& file : fs::directory_iterator(root() / kLogAsideFolder))
        all.push_back(text_of_file(file.path()));
      EXPECT_THAT(all, Contains(HasSubstr(signed_behind))) << "kill at call " << at;
      EXPECT_THAT(types(), Contains("damage-found")) << "kill at call " << at;
      ASSERT_FALSE(HasFailure());
    }
  }
}

// Readers get no further than so many zeros, though no line of them is too long.
TEST_F(ForeignLines, ManySignedLinesThatBecameZerosKeepNobodyFromRecording) {
  {
    const auto log = open();
    for (int i = 0; i < 70; ++i) log->access("*", "unlocked", "sato");
  }
  std::string last_line = text_of_file(ledger());
  last_line = last_line.substr(last_line.rfind('\n', last_line.size() - 2) + 1);
  std::ofstream(ledger(), std::ios::binary) << "";
  for (int i = 0; i < 70; ++i) {
    add_hole(kMaximumLineBytes);
    add_text("\n");
  }
  add_text(last_line);
  open()->access("*", "locked", "sato");
  EXPECT_LT(fs::file_size(ledger()), kMostBytesOfLine + kMaximumLineBytes);
  std::ifstream log(ledger(), std::ios::binary);
  log.seekg(static_cast<std::streamoff>(kMostBytesOfLine - kMaximumLineBytes));
  const std::string end{std::istreambuf_iterator<char>(log), {}};
  for (const std::string& what : {std::string("\nset aside: a line of 1048576 bytes"), last_line,
                                  std::string("damage-found"), std::string("locked")}) {
    EXPECT_NE(end.find(what), std::string::npos) << what;
  }
}

TEST_F(ForeignLines, AnUnreadableSignedLineWhoseFollowersFindNoRoomIsLeftAndTold) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  const std::string text = text_of_file(ledger());
  put_in_place(ledger(), text.find('\n') + 1, text.find('\n') + 2, std::string(2 * kMaximumLineBytes, 'x'));
  const std::string changed = text_of_file(ledger());
  FaultFileSystem files(root());
  files.fail("create log-aside", ENOSPC);
  EXPECT_THROW(open(files, key_), Error);
  EXPECT_EQ(text_of_file(ledger()), changed) << "what is signed is not cut off";
}

// It is the device's all the same, and all of it is there.
TEST_F(ForeignLines, ASignedLineWithoutItsEndGetsItBack) {
  open()->case_held(kCase, "court order", "anna");
  const std::string text = text_of_file(ledger());
  std::ofstream(ledger(), std::ios::binary) << text.substr(0, text.size() - 1);
  {
    const auto log = open();
    log->access("*", "unlocked", "sato");
    EXPECT_THAT(log->remarks(), Contains(HasSubstr("had lost its end")));
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(aside(), IsEmpty());
  EXPECT_THAT(codes(), Not(HasSubstr("tampered log-")));
  // What a power cut left of a line that nobody signed is cut off as ever.
  add_text(R"({"type":"access")");
  open();
  EXPECT_THAT(text_of_file(ledger()), Not(testing::EndsWith("\"access\"")));
}

TEST_F(ForeignLines, ALineThatIsJustTooLongIsPutAsideOnce) {
  open()->access("*", "unlocked", "sato");
  const std::string text = std::string(kMaximumLineBytes + 100'000, 'x') + "\n";
  add_text(text);
  const auto log = open();
  EXPECT_THAT(log->remarks(), SizeIs(1));
  EXPECT_THAT(deeds(), SizeIs(1));
  EXPECT_THAT(aside(), ElementsAre(text));
  EXPECT_EQ(codes(), "intact");
}

// Holes take no room of what is kept back.
TEST_F(ForeignLines, OnAFullDiskHolesAreNoReasonToLeaveLines) {
  open()->access("*", "unlocked", "sato");
  SpaceReserve(real_file_system(), reserve_file(root())).fill();
  FaultFileSystem files(root());
  const auto log = open(files, key_);
  add_text("nonsense");
  add_hole(std::uint64_t{1} << 30U);
  add_text("\n");
  files.fail("create log-aside", ENOSPC, 0, 1);
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(aside(), Contains(testing::StartsWith("nonsense")));
  EXPECT_EQ(codes(), "intact");
}

// Of another length than it had, or gone: whoever has the log open goes on, and says so.
TEST_F(TwoProcesses, GoOnWhereLinesAreOthersOrGoneAndSaySo) {
  for (const bool is_recorder : {true, false}) {
    for (const std::string_view how : {"longer", "shorter", "fewer", "none"}) {
      fs::remove_all(log_folder());
      shared_.note.reset();
      const auto recorder = open_one(), viewer = open_one();
      for (int i = 0; i < 4; ++i) recorder->access("*", "unlocked", "sato");
      static_cast<void>(viewer->head());
      std::string text = text_of_file(ledger());
      if (how == "longer") text.replace(text.find("unlocked"), 8, "unlocked twice");
      if (how == "shorter") text.replace(text.find("unlocked"), 8, "lock");
      if (how == "fewer") text = text.substr(0, text.rfind('\n', text.size() - 2) + 1);
      if (how == "none") text.clear();
      std::ofstream(ledger(), std::ios::binary) << text;
      ApplianceLog& log = is_recorder ? *recorder : *viewer;
      log.case_opened(kCase, some_hash());
      log.case_closed(kCase, 9, some_hash(), {});
      EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text)) << how;
      EXPECT_THAT(types(), AllOf(Contains("damage-found"), Contains("case-closed"))) << how << is_recorder;
      EXPECT_THAT(log.remarks(), Contains(HasSubstr("were changed while it was open"))) << how;
      (is_recorder ? *viewer : *recorder).access("*", "unlocked", "mori");
      EXPECT_EQ(std::ranges::count(types(), "damage-found"), 1) << how;
      EXPECT_THAT(codes(), testing::StartsWith("tampered")) << how;
    }
  }
}

// Who cannot read them neither takes for the device's what somebody added, nor stops.
TEST_F(TwoProcesses, JudgeByWhatTheHomeRemembersWhereCheckpointsCannotBeRead) {
  HookedFiles files;
  const auto hide = [&] {
    files.hook = [&](const fs::path& path) { return path == log_folder() / kCheckpointsFolder ? EACCES : 0; };
  };
  const auto open_hidden = [&](LogMemory memory) {
    return ApplianceLog::open(files, log_folder(), key_, "theatre-1", {}, std::move(memory));
  };
  for (const bool is_open_before : {false, true}) {
    for (const bool is_remembered : {true, false}) {
      fs::remove_all(log_folder());
      shared_.note.reset();
      files.hook = nullptr;
      open_one()->case_held(kCase, "court order", "anna");
      auto log = is_open_before ? open_hidden(is_remembered ? shared_.of_one() : LogMemory{}) : nullptr;
      const std::string before = text_of_file(ledger());
      hide();
      add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
      const std::string text = text_of_file(ledger());
      if (!log) log = open_hidden(is_remembered ? shared_.of_one() : LogMemory{});
      log->case_opened(kCase, some_hash());
      log->case_closed(kCase, 9, some_hash(), {});
      EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(before));
      files.hook = nullptr;
      if (is_remembered) {
        EXPECT_THAT(text_of_file(ledger()), Not(testing::StartsWith(text)));
        EXPECT_THAT(codes(), Not(HasSubstr("tampered log-")));
      } else {
        EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text)) << "nobody knows whose it is";
        EXPECT_THAT(
            deeds(),
            ElementsAre(testing::MatchesRegex("found no signature of this device over entries [0-2] to 2")));
      }
      EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt);
      EXPECT_EQ(open()->stated_keys().ml_dsa, std::nullopt);
    }
  }
}

// Nor does whoever puts something else in the folder's place.
TEST_F(ForeignLines, AFolderOfCheckpointsThatIsNoneKeepsNobodyFromRecording) {
  const fs::path checkpoints = log_folder() / kCheckpointsFolder;
  for (const std::string_view instead : {"nothing", "a file", "a link"}) {
    for (const bool at_a_start : {false, true}) {
      fs::remove_all(log_folder());
      auto log = open();
      log->access("*", "unlocked", "sato");
      fs::remove_all(checkpoints);
      if (instead == "a file") std::ofstream(checkpoints) << "in the way";
      if (instead == "a link") fs::create_symlink(root() / "nowhere", checkpoints);
      if (at_a_start) log = open();
      log->case_opened(kCase, some_hash());
      log->case_closed(kCase, 9, some_hash(), {});
      EXPECT_THAT(types(), Contains("case-closed")) << instead;
      if (instead == "nothing") {
        EXPECT_TRUE(fs::exists(log_folder() / note_path(log->size())));
      } else {
        EXPECT_THAT(log->remarks(), Contains(HasSubstr("cannot be written"))) << instead;
        EXPECT_THROW(log->case_held(kCase, "court order", "anna"), Error) << "nobody may count on it";
      }
    }
  }
}

// Somebody says so often which entries have no signature, or states keys, that looking at each pair would
// take hours; and a recorder of before signed over all of it.
TEST_F(ForeignLines, ThousandsThatWereSignedOverHoldUpNoEntry) {
  constexpr std::uint64_t kLines = 20'000;
  open()->case_held(kCase, "court order", "anna");
  LogEntry entry = last();
  std::string text;
  for (std::uint64_t i = 0; i < kLines; ++i) {
    const std::uint64_t number = ++entry.seq;
    if (i % 4 == 0) {
      entry.body = DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()};
    } else if (i % 4 == 1) {
      // Of the line before alone, or of none that is there.
      entry.body = AccessEntry{"*",
                               "found no signature of this device over entries " +
                                   std::to_string(number - 1) + " to " + std::to_string(number - 1),
                               "kiroku",
                               {}};
    } else {
      entry.body = LogDamageEntry{2, some_hash(), some_hash()};
    }
    text += to_line(entry) + "\n";
  }
  add_text(text);
  sign("theatre-1", key_);
  const auto log = open();
  for (int i = 0; i < 20; ++i) log->access("*", "unlocked", "sato");
  EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt);
  EXPECT_THAT(why_held(read_holds(log_folder(), device_), kCase), HasSubstr("court order"));
}

// As each by itself would be judged.
TEST_F(ForeignLines, ClaimsOfDamageAreRefutedByWhatTheDeviceSignedBeforeThem) {
  {
    const auto log = open();
    for (int i = 0; i < 8; ++i) log->access("*", "unlocked", "sato");
  }
  // Of the nine entries the first one has no checkpoint; these lose theirs, or have somebody's.
  fs::remove(log_folder() / note_path(4));
  fs::remove(log_folder() / note_path(7));
  const crypto::Checkpoint other{log_origin("theatre-1"), 6, some_hash()};
  std::ofstream(log_folder() / note_path(6)) << crypto::sign_note(other.to_text(), "theatre-1", key_);
  const auto fits = [](std::uint64_t size) { return size > 1 && size != 4 && size != 6 && size != 7; };
  std::vector<DamageClaim> refuted;
  for (std::uint64_t entry = 1; entry <= 9; ++entry) {
    for (std::uint64_t size = 1; size <= 9; ++size) {
      bool is_refuted = false;
      for (std::uint64_t signed_size = size; signed_size <= entry; ++signed_size)
        is_refuted = is_refuted || fits(signed_size);
      const DamageClaim claim{entry, size};
      if (is_refuted) refuted.push_back(claim);
      std::vector<DamageClaim> claims = refuted;
      if (!is_refuted) claims.push_back(claim);
      const auto stands = first_that_stands(log_folder(), device_, claims);
      EXPECT_EQ(stands.has_value(), !is_refuted) << entry << " " << size;
      EXPECT_EQ(stands ? stands->entry : entry, entry);
    }
  }
}

TEST_F(ForeignLines, ALogOfAnotherDeviceIsLeftAndSaysWhoseItIsFromNowOn) {
  {
    const auto others = ApplianceLog::open(real_file_system(), log_folder(), stranger_, "theatre-2");
    others->case_opened(kCase, some_hash());
    others->case_closed(kCase, 9, some_hash(), {});
  }
  const std::string text = text_of_file(ledger());
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(aside(), IsEmpty());
  EXPECT_EQ(parse_log_entry(read_log(log_folder())[4].json).entry->seq, 4U);
  EXPECT_EQ(std::get<BootEntry>(parse_log_entry(read_log(log_folder())[4].json).entry->body).device,
            device_.to_string());
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 0 to 3"));
  EXPECT_THAT(codes(), Not(HasSubstr("checkpoint-unknown-key")));
}

/// A case of this device, begun beside the log, whose checkpoint in the log somebody took away. Somebody's
/// line stands before the one that opens it.
class ForeignLinesBeforeACase : public ForeignLines {
 protected:
  void record(const crypto::SigningKey& key, ApplianceLog* log) {
    test::CaseKit kit(root());
    CaseWriter::Options options = kit.options();
    options.key = &key;
    options.log = log;
    const auto writer = CaseWriter::create(real_file_system(), options, test::moment(0));
    writer->checkpoint(test::moment(1));
    case_id_ = writer->case_id();
  }
  /// Its line as it would follow.
  void add_opening() const {
    std::ifstream input(root() / case_id_ / kLedgerFile);
    std::string line;
    std::getline(input, line);
    add(CaseOpenedEntry{case_id_, crypto::sha256(bytes_of(line))});
  }

  /// A case and its line, with somebody's before it; all that the log has behind its second entry.
  void record_and_lose_its_checkpoint() {
    {
      const auto log = open();
      log->access("*", "unlocked", "sato");
      record(key_, log.get());
    }
    const std::string text = text_of_file(ledger());
    std::ofstream(ledger(), std::ios::binary)
        << text.substr(0, text.rfind('\n', text.find("\"case-opened\"")) + 1);
    for (const std::uint64_t size : {3U, 4U}) fs::remove(log_folder() / note_path(size));
    add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
    add_opening();
  }

  std::string case_id_;
};

// It must not be lost to the log, whoever stands before its line.
TEST_F(ForeignLinesBeforeACase, ThatIsHereAreLeftAndNamed) {
  record_and_lose_its_checkpoint();
  const std::string text = text_of_file(ledger());
  {
    const auto log = open();
    EXPECT_EQ(log->case_state(case_id_), ApplianceLog::CaseState::kOpened);
    log->access("*", "unlocked", "sato");
  }
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  EXPECT_THAT(deeds(), ElementsAre("found no signature of this device over entries 2 to 3"));
  const auto log = open();
  log->access("*", "unlocked", "sato");
  EXPECT_EQ(log->stated_keys().ml_dsa, std::nullopt) << "though a checkpoint covers that line now";
}

// Nor to whatever keeps the recorder from looking at the case.
TEST_F(ForeignLinesBeforeACase, WhichCannotBeReadNowAreLeft) {
  record_and_lose_its_checkpoint();
  const std::string text = text_of_file(ledger());
  for (const std::string_view which : {"ledger.jsonl", "checkpoints", ".note"}) {
    for (const int error : {EMFILE, ENFILE, ESTALE, ENOMEM, EIO}) {
      HookedFiles files;
      files.hook = [&](const fs::path& path) {
        const std::string name = path.string();
        return name.find(case_id_) != std::string::npos && name.ends_with(which) ? error : 0;
      };
      open(files, key_);
      EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text)) << which << " " << error;
      EXPECT_THAT(aside(), IsEmpty());
      std::ofstream(ledger(), std::ios::binary) << text;
      for (const std::uint64_t size : {5U, 6U}) fs::remove(log_folder() / note_path(size));
    }
  }
}

// Of cases that the device recorded beside another log: the log would be read for each.
TEST_F(ForeignLinesBeforeACase, HaveTheLogReadNoMoreForManyCases) {
  open()->access("*", "unlocked", "sato");
  std::vector<std::ptrdiff_t> readings;
  for (const int cases : {1, 4}) {
    add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
    for (int i = 0; i < cases; ++i) {
      TemporaryFolder elsewhere(test::quick_parent());
      const auto another =
          ApplianceLog::open(real_file_system(), elsewhere.path() / "log", key_, "theatre-1");
      another->access("*", "unlocked", "sato");
      record(key_, another.get());
      add_opening();
    }
    FaultFileSystem files(root());
    const auto log = open(files, key_);
    EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("this device did not write")));
    readings.push_back(std::ranges::count(files.reads(), "open log/ledger.jsonl"));
  }
  EXPECT_EQ(readings[0], readings[1]);
}

// Whoever can write to the archive makes a folder that fits any line; only the device makes a case of its.
TEST_F(ForeignLinesBeforeACase, ThatSomebodyMadeToFitArePutAside) {
  open()->access("*", "unlocked", "sato");
  // Nobody's; another key's; the device's own, begun beside another log; one whose signature was changed.
  for (int which = 0; which < 4; ++which) {
    if (which == 0) {
      case_id_ = kCase;
      fs::create_directory(root() / kCase);
      std::ofstream(root() / kCase / kLedgerFile) << "abc\n";
    } else {
      TemporaryFolder elsewhere(test::quick_parent());
      const auto another =
          which == 2 ? ApplianceLog::open(real_file_system(), elsewhere.path() / "log", key_, "theatre-1")
                     : nullptr;
      if (another) another->access("*", "unlocked", "sato");
      record(which == 1 ? stranger_ : key_, another.get());
      if (which == 3) std::ofstream(root() / case_id_ / note_path(1), std::ios::app) << "x";
    }
    add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
    add_opening();
    const auto log = open();
    EXPECT_THAT(log->remarks(), ElementsAre(HasSubstr("this device did not write"))) << which;
    log->access("*", "unlocked", "sato");
    EXPECT_EQ(log->case_state(case_id_), ApplianceLog::CaseState::kUnknown) << which;
    EXPECT_THAT(codes(), testing::StartsWith("intact")) << which;
  }
}

TEST_F(ForeignLines, ACaseThatIsKnownAlreadyKeepsNone) {
  open()->case_opened(kCase, some_hash());
  fs::create_directory(root() / kCase);
  std::ofstream(root() / kCase / kLedgerFile) << "abc\n";
  add(DeviceMlDsaEntry{a_strangers_key().ml_dsa()->to_string()});
  add(CaseOpenedEntry{kCase, some_hash()});
  open()->access("*", "unlocked", "sato");
  EXPECT_THAT(types(), ElementsAre("boot", "case-opened", "recovered", "access", "access"));
}

// Somebody says of the line that states the device's key that nobody signed it.
TEST_F(ForeignLines, WhatSomebodySaysToBeUnsignedIsTheDevicesAllTheSame) {
  const crypto::SigningKey both = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                      .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  open(real_file_system(), both)->access("*", "unlocked", "sato");
  add(AccessEntry{"*", "found no signature of this device over entries 0 to 2", "kiroku", {}});
  add(AccessEntry{"*", "unlocked", "sato", {}});
  open(real_file_system(), both)->access("*", "unlocked", "sato");
  EXPECT_THAT(types(),
              ElementsAre("boot", "device-ml-dsa-added", "access", "access", "access", "access", "access"));
  EXPECT_THAT(deeds(), Contains("found no signature of this device over entries 3 to 4"));
  EXPECT_THAT([&] { open(); }, testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
}

// Whoever takes all checkpoints away, or those that show it, does not have the recorder put its own lines
// aside.
TEST_F(ForeignLines, AreLeftWhereTheDevicesOwnLinesWouldGoWithThem) {
  {
    const auto log = open();
    for (int i = 0; i < 4; ++i) log->case_held(kCase, "court order", "anna");
  }
  const crypto::Checkpoint kept{log_origin("theatre-1"), 5, root_of_all()};
  std::string text = text_of_file(ledger());
  text.replace(text.find("court order"), 11, "court\x01order");
  std::ofstream(ledger(), std::ios::binary) << text;
  for (const std::uint64_t size : {5U, 4U, 3U, 2U}) fs::remove(log_folder() / note_path(size));
  EXPECT_THAT(open()->remarks(), ElementsAre(HasSubstr("are left")));
  EXPECT_THAT(text_of_file(ledger()), testing::StartsWith(text));
  const auto log = open(real_file_system(), key_, kept);
  EXPECT_THAT(log->lacks(), Not(IsEmpty()));
  EXPECT_THAT(aside(), IsEmpty());
}

// Another program of the same home, with fewer keys, would take it for somebody else's.
TEST_F(ForeignLines, AProgramWithAnotherMlDsaKeyPutsNothingAside) {
  const auto with_one_more = [&] {
    return crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
        .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  };
  const crypto::SigningKey first = with_one_more(), second = with_one_more();
  open(real_file_system(), first)->access("*", "unlocked", "sato");
  const std::string text = text_of_file(ledger());
  EXPECT_THAT([&] { open(real_file_system(), second); },
              testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
  EXPECT_EQ(text_of_file(ledger()), text);
  EXPECT_THAT(aside(), IsEmpty());
}

TEST_F(ForeignLines, TheOwnKeyIsSignedAsSoonAsItIsStated) {
  const crypto::SigningKey both = crypto::SigningKey::from_pem(key_.to_pem(nullptr).text(), nullptr)
                                      .with_ml_dsa(crypto::MlDsaPrivateKey::generate(crypto::MlDsaSet::k65));
  open(real_file_system(), both)->boot("b1");
  EXPECT_TRUE(fs::exists(log_folder() / note_path(2)));
  EXPECT_THAT([&] { open(); }, testing::ThrowsMessage<Error>(HasSubstr("device-ml-dsa.key")));
  EXPECT_THAT(types(), ElementsAre("boot", "device-ml-dsa-added"));
}

}  // namespace
}  // namespace kiroku::archive
