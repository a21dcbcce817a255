// Attacks on the files of a case.
#include <functional>
#include <sys/stat.h>
#include <unistd.h>

#include "crypto/age_file.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFilm0 = "segments/endoscope/00000000.ts.age";
constexpr const char* kFilm1 = "segments/endoscope/00000001.ts.age";
constexpr const char* kVitals = "segments/vitals/00000000.jsonl.age";

/// The payload of a segment under a second header that opens it as well.
std::string with_another_header(const fs::path& file) {
  SampleArchive& archive = SoundCases::get().archive;
  const auto source = crypto::open_file_source(file);
  std::uint64_t old_header = 0;
  const Bytes header = crypto::rekey_header(*source, archive.identities(), archive.recipients(), old_header);
  return std::string(text_of(header)) + read_file(file).substr(old_header);
}

/// The file becomes a hole of so many bytes, and the entry states them.
void make_a_hole(AttackedCase& victim, const std::string& file, std::uint64_t entry, std::uint64_t bytes) {
  fs::resize_file(victim / file, 0);
  fs::resize_file(victim / file, bytes);
  victim.edit(entry, [&](archive::CaseEntry& each) {
    if (auto* open = std::get_if<archive::OpenEntry>(&each.body)) {
      open->subject->bytes = bytes;
    } else {
      std::get<archive::SegmentEntry>(each.body).file.bytes = bytes;
    }
  });
}

class AttackOnFiles : public ::testing::TestWithParam<Attack> {};

TEST_P(AttackOnFiles, IsTold) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Table, AttackOnFiles,
    ::testing::Values(
        Attack{"SegmentRemoved", [](AttackedCase& c) { fs::remove(c / kFilm1); }, "file-missing", kFilm1, 4},
        Attack{"SegmentsSwapped",
               [](AttackedCase& c) {
                 const std::string film = read_file(c / kFilm0);
                 write_file(c / kFilm0, read_file(c / kFilm1));
                 write_file(c / kFilm1, film);
               },
               "file-hash-differs", kFilm0, 3},
        Attack{"SegmentRepeated", [](AttackedCase& c) { write_file(c / kFilm1, read_file(c / kFilm0)); },
               "file-hash-differs", kFilm1, 4},
        Attack{"SegmentTruncated", [](AttackedCase& c) { fs::resize_file(c / kFilm1, 65'000); },
               "file-size-differs", kFilm1, 4},
        Attack{"SegmentLengthened",
               [](AttackedCase& c) { write_file(c / kFilm1, read_file(c / kFilm1) + "x"); },
               "file-size-differs", kFilm1, 4},
        Attack{"SegmentEmptied", [](AttackedCase& c) { fs::resize_file(c / kFilm1, 0); }, "file-size-differs",
               kFilm1, 4},
        Attack{"SegmentThatIsAHoleOf8Tebibytes",
               [](AttackedCase& c) { make_a_hole(c, kFilm1, 4, std::uint64_t{8} << 40U); }, "file-too-large",
               kFilm1, 4},
        Attack{"SubjectThatIsAHoleOf8Tebibytes",
               [](AttackedCase& c) { make_a_hole(c, "subject.json.age", 0, std::uint64_t{8} << 40U); },
               "file-too-large", "subject.json.age", 0},
        Attack{"SegmentThatIsAHoleOfAGibibyte",
               [](AttackedCase& c) { make_a_hole(c, kFilm1, 4, std::uint64_t{1} << 30U); }, "file-has-hole",
               kFilm1, 4},
        Attack{"SegmentOfAnotherCase",
               [](AttackedCase& c) { write_file(c / kFilm1, read_file(SoundCases::get().second / kFilm1)); },
               "file-hash-differs", kFilm1, 4},
        Attack{"SecondHeaderOverOnePayload",
               [](AttackedCase& c) { write_file(c / kFilm1, with_another_header(c / kFilm1)); },
               "file-hash-differs", kFilm1, 4},
        Attack{"SegmentSealedAnewForTheSameRecipients",
               [](AttackedCase& c) {
                 const Bytes other =
                     crypto::seal_bytes(Bytes(70'000), SoundCases::get().archive.recipients());
                 write_file(c / kFilm1, std::string(text_of(other)));
               },
               "file-hash-differs", kFilm1, 4},
        Attack{"SegmentBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c / kFilm1, c.outside("film"));
                 fs::create_symlink(c.outside("film"), c / kFilm1);
               },
               "file-not-regular", kFilm1, 4},
        Attack{"StreamBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c / "segments/endoscope", c.outside("endoscope"));
                 fs::create_directory_symlink(c.outside("endoscope"), c / "segments/endoscope");
               },
               "file-not-regular",
               "segments/endoscope",
               {}},
        Attack{"CheckpointBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c / "checkpoints/00000011.note", c.outside("note"));
                 fs::create_symlink(c.outside("note"), c / "checkpoints/00000011.note");
               },
               "file-not-regular",
               "checkpoints/00000011.note",
               {}},
        Attack{"TokenBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c / "tokens/00000006.embedded.tsr", c.outside("token"));
                 fs::create_symlink(c.outside("token"), c / "tokens/00000006.embedded.tsr");
               },
               "file-not-regular", "tokens/00000006.embedded.tsr", 6},
        Attack{"LedgerBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c / "ledger.jsonl", c.outside("ledger"));
                 fs::create_symlink(c.outside("ledger"), c / "ledger.jsonl");
               },
               "file-not-regular",
               "ledger.jsonl",
               {}},
        Attack{"LinkAmongTheAuthorities",
               [](AttackedCase& c) { fs::create_symlink("/etc/passwd", c / "authorities/root.pem"); },
               "file-not-regular",
               "authorities/root.pem",
               {}},
        Attack{"DanglingLink",
               [](AttackedCase& c) { fs::create_symlink("nowhere", c / "notes"); },
               "file-not-regular",
               "notes",
               {}},
        Attack{"FifoInPlaceOfASegment",
               [](AttackedCase& c) {
                 fs::remove(c / kFilm1);
                 ASSERT_EQ(mkfifo((c / kFilm1).c_str(), 0600), 0);
               },
               "file-not-regular", kFilm1, 4},
        Attack{"FifoBesideTheSegments",
               [](AttackedCase& c) { ASSERT_EQ(mkfifo((c / "segments/endoscope/pipe").c_str(), 0600), 0); },
               "file-not-regular",
               "segments/endoscope/pipe",
               {}},
        Attack{"FolderInPlaceOfASegment",
               [](AttackedCase& c) {
                 fs::remove(c / kFilm1);
                 fs::create_directory(c / kFilm1);
               },
               "file-not-regular", kFilm1, 4},
        Attack{"StrayFile",
               [](AttackedCase& c) { write_file(c / "readme.txt", "x"); },
               "file-unnamed",
               "readme.txt",
               {}},
        Attack{"HiddenFile",
               [](AttackedCase& c) { write_file(c / "segments/.hidden", ""); },
               "file-unnamed",
               "segments/.hidden",
               {}},
        Attack{"StrayFolder",
               [](AttackedCase& c) { fs::create_directories(c / "segments/surgeon"); },
               "file-unnamed",
               "segments/surgeon",
               {}},
        Attack{"StrayFolderFarBelow",
               [](AttackedCase& c) { fs::create_directories(c / "segments/endoscope/a/b/c"); },
               "file-unnamed",
               "segments/endoscope/a",
               {}},
        Attack{"SegmentAddedBehindTheLast",
               [](AttackedCase& c) { fs::copy_file(c / kFilm1, c / "segments/endoscope/00000003.ts.age"); },
               "file-unnamed",
               "segments/endoscope/00000003.ts.age",
               {}},
        Attack{"PartFileInAClosedCase",
               [](AttackedCase& c) { write_file(c / "segments/endoscope/00000003.ts.age.part", "x"); },
               "file-unnamed",
               "segments/endoscope/00000003.ts.age.part",
               {}},
        Attack{"TokenThatNothingEntered",
               [](AttackedCase& c) {
                 fs::copy_file(c / "tokens/00000010.embedded.tsr", c / "tokens/00000011.embedded.tsr");
               },
               "file-unnamed",
               "tokens/00000011.embedded.tsr",
               {}},
        Attack{"NamesThatDifferOnlyInCase",
               [](AttackedCase& c) { fs::copy_file(c / kFilm1, c / "segments/endoscope/00000001.TS.age"); },
               "name-clash",
               kFilm1,
               {}},
        Attack{"FoldersThatDifferOnlyInCase",
               [](AttackedCase& c) { fs::create_directory(c / "Segments"); },
               "name-clash",
               "segments",
               {}},
        Attack{"SubjectExchanged",
               [](AttackedCase& c) {
                 write_file(c / "subject.json.age", read_file(SoundCases::get().second / "subject.json.age"));
               },
               "file-hash-differs", "subject.json.age", 0},
        Attack{"SubjectRemoved", [](AttackedCase& c) { fs::remove(c / "subject.json.age"); }, "file-missing",
               "subject.json.age", 0},
        Attack{"VitalsRemoved", [](AttackedCase& c) { fs::remove(c / kVitals); }, "file-missing", kVitals, 8},
        Attack{"AllSegmentsRemoved", [](AttackedCase& c) { fs::remove_all(c / "segments"); }, "file-missing",
               kFilm0, 3}),
    name_of);

/// Which of them is read is left to chance.
TEST(AttackOnFilesWithoutRoom, AFileUnderTwoNamesIsReadOnce) {
  AttackedCase victim;
  fs::remove(victim / kFilm1);
  fs::create_hard_link(victim / kFilm0, victim / kFilm1);
  const auto stated = archive::parse_case_entry(victim.lines().at(3)).entry.value();
  victim.edit(4, [&](archive::CaseEntry& each) {
    auto& file = std::get<archive::SegmentEntry>(each.body).file;
    const std::string name = file.file;
    file = std::get<archive::SegmentEntry>(stated.body).file;
    file.file = name;
  });
  const archive::VerificationReport report = victim.verify();
  EXPECT_THAT(summary(report), ::testing::HasSubstr("file-not-regular segments/endoscope/0000000"));
}

TEST(AttackOnFilesWithoutRoom, ACopyOfACaseByHardLinksIsIntact) {
  AttackedCase victim;
  for (const auto& file : fs::recursive_directory_iterator(victim.folder())) {
    if (file.is_regular_file()) {
      fs::create_hard_link(file,
                           victim.outside(std::to_string(std::hash<std::string>{}(file.path().string()))));
    }
  }
  EXPECT_EQ(summary(victim.verify()), "intact");
}

/// A power cut leaves files with holes, but no hour of reading.
TEST(AttackOnFilesWithoutRoom, OfCutOffFilesSoManyHolesAreReadAndNoMore) {
  constexpr std::uint64_t kHole = std::uint64_t{600} << 20U;
  AttackedCase victim;
  for (std::uint64_t entry = 3; entry <= 4; ++entry) {
    const std::string name = "segments/endoscope/0000000" + std::to_string(entry - 3) + ".ts.age";
    fs::rename(victim / name, victim / (name + ".part"));
    make_a_hole(victim, name + ".part", entry, kHole);
    victim.edit(entry, [&](archive::CaseEntry& each) {
      auto& segment = std::get<archive::SegmentEntry>(each.body);
      segment.complete = segment.counted = false;
      segment.file.file += ".part";
    });
  }
  std::size_t read = 0, left = 0;
  const archive::VerificationReport report = victim.verify();
  for (const archive::Finding& finding : report.findings) {
    read += finding.code == "file-hash-differs" ? 1U : 0U;
    left += finding.code == "file-has-hole" ? 1U : 0U;
  }
  EXPECT_EQ(read, 1U) << details(report);
  EXPECT_EQ(left, 1U) << details(report);
}

TEST(AttackOnFilesOfSomebodyElse, AFileThatMayNotBeReadIsUnprovenAndNotTampered) {
  if (geteuid() == 0) {
    GTEST_SKIP() << "root may read everything";
  }
  AttackedCase victim;
  fs::permissions(victim / kFilm1, fs::perms::none);
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(summary(report), std::string("unproven\nfile-unreadable ") + kFilm1 + " 4");
}

TEST(AttackOnFilesAnew, ASegmentMadeByOneWhoKnowsTheRecipientsIsToldApart) {
  AttackedCase victim;
  SampleArchive& archive = SoundCases::get().archive;
  write_file(victim / kFilm1, std::string(text_of(crypto::seal_bytes(Bytes(70'000), archive.recipients()))));
  archive::VerifyOptions options = archive.options();
  options.identities = &archive.identities();
  const archive::VerificationReport report = archive::verify_case(victim.folder(), options);
  ASSERT_EQ(summary(report), std::string("tampered\nfile-hash-differs ") + kFilm1 + " 4");
  EXPECT_THAT(report.findings[0].text, ::testing::HasSubstr("yet it decrypts"));
}

}  // namespace
}  // namespace kiroku::test
