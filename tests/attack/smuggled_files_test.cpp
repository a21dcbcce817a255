// Somebody puts what no entry names where it may be passed over: among the certificates, under the names of
// checkpoints, behind the suffix of unfinished files. Each must be told.
#include <algorithm>
#include <cerrno>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include "archive/reading/excerpt.h"
#include "tests/attack/attack_table.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kCertificates = "authorities/embedded.pem";

void bind_socket(const fs::path& file) {
  const int descriptor = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
  ASSERT_GE(descriptor, 0);
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  ASSERT_LT(file.string().size(), sizeof(address.sun_path));
  std::ranges::copy(file.string(), address.sun_path);
  ASSERT_EQ(::bind(descriptor, reinterpret_cast<const sockaddr*>(&address), sizeof(address)), 0);
  ::close(descriptor);
}

class Smuggling : public ::testing::TestWithParam<Attack> {};

TEST_P(Smuggling, IsTold) { expect_told(GetParam()); }

INSTANTIATE_TEST_SUITE_P(
    Table, Smuggling,
    ::testing::Values(
        Attack{"FileAmongTheAuthorities",
               [](AttackedCase& c) { write_file(c / "authorities/film.mp4", "x"); },
               "file-unnamed",
               "authorities/film.mp4",
               {}},
        Attack{"HiddenFileAmongTheAuthorities",
               [](AttackedCase& c) { write_file(c / "authorities/.embedded.pem", "x"); },
               "file-unnamed",
               "authorities/.embedded.pem",
               {}},
        Attack{"FolderAmongTheAuthorities",
               [](AttackedCase& c) { fs::create_directory(c / "authorities/more"); },
               "file-unnamed",
               "authorities/more",
               {}},
        Attack{"FolderNamedAsCertificates",
               [](AttackedCase& c) {
                 fs::remove(c / kCertificates);
                 fs::create_directory(c / kCertificates);
               },
               "file-unnamed",
               kCertificates,
               {}},
        Attack{"FileFarBelowTheAuthorities",
               [](AttackedCase& c) {
                 fs::create_directories(c / "authorities/a/b/c");
                 write_file(c / "authorities/a/b/c/film.mp4", "x");
               },
               "file-unnamed",
               "authorities/a/b",
               {}},
        Attack{"LinkInPlaceOfCertificates",
               [](AttackedCase& c) {
                 fs::rename(c / kCertificates, c.outside("chain"));
                 fs::create_symlink(c.outside("chain"), c / kCertificates);
               },
               "file-not-regular",
               kCertificates,
               {}},
        Attack{"FifoInPlaceOfCertificates",
               [](AttackedCase& c) {
                 fs::remove(c / kCertificates);
                 ASSERT_EQ(mkfifo((c / kCertificates).c_str(), 0600), 0);
               },
               "file-not-regular",
               kCertificates,
               {}},
        Attack{"SocketAmongTheAuthorities",
               [](AttackedCase& c) { bind_socket(c / "authorities/s"); },
               "file-not-regular",
               "authorities/s",
               {}},
        Attack{"NoCertificatesOfAnAuthorityThatNothingNames",
               [](AttackedCase& c) { write_file(c / "authorities/swiss.pem", "a film, for instance"); },
               "file-unnamed",
               "authorities/swiss.pem",
               {}},
        Attack{"CertificatesThatAreFarTooLong",
               [](AttackedCase& c) {
                 std::string many;
                 while (many.size() <= 300'000) {
                   many += read_file(c / kCertificates);
                 }
                 write_file(c / "authorities/swiss.pem", many);
               },
               "file-unnamed",
               "authorities/swiss.pem",
               {}},
        Attack{"FolderNamedAsACheckpoint",
               [](AttackedCase& c) { fs::create_directory(c / "checkpoints/00000007.note"); },
               "file-unnamed",
               "checkpoints/00000007.note",
               {}},
        Attack{"CheckpointsOfTheLogBehindASymbolicLink",
               [](AttackedCase& c) {
                 fs::rename(c.log() / "checkpoints", c.outside("notes"));
                 fs::create_directory_symlink(c.outside("notes"), c.log() / "checkpoints");
               },
               "log-not-sound",
               "log/checkpoints",
               {},
               archive::Verdict::kUnproven,
               true},
        Attack{"FolderNamedAsACheckpointOfTheLog",
               [](AttackedCase& c) { fs::create_directory(c.log() / "checkpoints/00000009.note.part"); },
               "log-not-tidy",
               "log/checkpoints/00000009.note.part",
               {},
               archive::Verdict::kIntact,
               true},
        Attack{"FileOfTheLogThatPretendsToBeUnfinished",
               [](AttackedCase& c) { write_file(c.log() / "film.mp4.part", "x"); },
               "log-not-tidy",
               "log/film.mp4.part",
               {},
               archive::Verdict::kIntact,
               true}),
    name_of);

// They can be as long as somebody likes, and take no room.
TEST(FilesOfASystem, AreNotCountedAmongWhatWasRecorded) {
  constexpr std::uintmax_t kTerabyte = std::uintmax_t{1} << 40U;
  AttackedCase victim;
  const archive::VerificationReport sound = victim.verify();
  EXPECT_EQ(sound.left_by_systems, 0U);
  fs::create_directories(victim / "segments/@eaDir/more");
  write_file(victim / "segments/@eaDir/big", "x");
  fs::resize_file(victim / "segments/@eaDir/big", kTerabyte);
  write_file(victim / "Thumbs.db", "x");
  const archive::VerificationReport report = victim.verify();
  EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << details(report);
  EXPECT_EQ(report.bytes, sound.bytes);
  EXPECT_EQ(report.files, sound.files);
  EXPECT_EQ(report.left_by_systems, 2U);
}

// What operating systems leave in folders that they show or copy accuses nobody; nothing else may use that.
TEST(FilesOfASystem, AreANoteAndNothingElseIs) {
  AttackedCase victim;
  for (const char* file : {".DS_Store", "segments/endoscope/.DS_Store", "checkpoints/Thumbs.db",
                           "desktop.ini", "@eaDir/x", "ledger.jsonl:Zone.Identifier"}) {
    fs::create_directories((victim / file).parent_path());
    write_file(victim / file, "x");
    const archive::VerificationReport report = victim.verify();
    EXPECT_EQ(report.verdict, archive::Verdict::kIntact) << file << details(report);
    EXPECT_THAT(summary(report), ::testing::HasSubstr(std::string("file-of-a-system ") + file + " -"));
    fs::remove(victim / file);
  }
  fs::remove_all(victim / "@eaDir");
  for (const char* file : {"@eaDir", "thumbs.db", "film.DS_Store", ":Zone.Identifier",
                           "segments/endoscope/Thumbs.db.ts.age", "Zone.Identifier"}) {
    write_file(victim / file, "x");
    const archive::VerificationReport report = victim.verify();
    EXPECT_EQ(report.verdict, archive::Verdict::kTampered) << file << details(report);
    EXPECT_THAT(summary(report), ::testing::HasSubstr(std::string("file-unnamed ") + file + " -"));
    fs::remove(victim / file);
  }
  fs::create_symlink("ledger.jsonl", victim / ".DS_Store");
  EXPECT_THAT(summary(victim.verify()), ::testing::HasSubstr("file-not-regular .DS_Store -"));
}

TEST(SmugglingIntoAnOpenCase, AFileThatPretendsToBeUnfinishedIsTold) {
  AttackedCase victim;
  victim.cut(7);
  write_file(victim / "segments/endoscope/00000003.ts.age.part", "x");
  EXPECT_THAT(summary(victim.verify(false)),
              ::testing::HasSubstr("part-file segments/endoscope/00000003.ts.age.part -"));
  for (const char* file : {"film.mp4.part", "segments/film.part", "segments/endoscope/film.part",
                           "segments/endoscope/00000003.avi.age.part", "tokens/film.part"}) {
    write_file(victim / file, "x");
    const archive::VerificationReport report = victim.verify(false);
    EXPECT_EQ(report.verdict, archive::Verdict::kTampered) << file;
    EXPECT_THAT(summary(report), ::testing::HasSubstr(std::string("file-unnamed ") + file + " -"));
    fs::remove(victim / file);
  }
}

// A token's certificates are stored before its entry is: a power cut can come between.
TEST(CertificatesAmongTheAuthorities, ThatNoEntryNamesAreANote) {
  AttackedCase victim;
  fs::copy_file(victim / kCertificates, victim / "authorities/swiss.pem");
  EXPECT_EQ(summary(victim.verify()), "intact\nauthority-not-named authorities/swiss.pem -");
  fs::rename(victim / "authorities/swiss.pem", victim / "authorities/swiss.pem.part");
  EXPECT_EQ(summary(victim.verify()), "intact\npart-file authorities/swiss.pem.part -");
}

// Nothing is proven with them, so nothing is lost; but no more than certificates may hide there.
TEST(CertificatesAmongTheAuthorities, MustBeNothingElse) {
  AttackedCase victim;
  const std::string sound = read_file(victim / kCertificates);
  ASSERT_TRUE(sound.starts_with("-----BEGIN CERTIFICATE-----\n"));
  std::string cut_in_two = sound;
  cut_in_two.replace(cut_in_two.find('\n', 40), 1, "=\n");
  for (const std::string& other :
       {std::string(), std::string("x"), sound + "x", "a film\n" + sound, sound + "\n" + sound + "film\n",
        std::string("-----BEGIN CERTIFICATE-----\nAAAA\n-----END CERTIFICATE-----\n"),
        std::string("-----BEGIN FILM-----\nAAAA\n-----END FILM-----\n"), cut_in_two}) {
    write_file(victim / kCertificates, other);
    const archive::VerificationReport report = victim.verify();
    EXPECT_EQ(summary(report), std::string("intact\nauthority-file-malformed ") + kCertificates + " -")
        << other;
  }
  write_file(victim / kCertificates, sound + sound);
  EXPECT_EQ(summary(victim.verify()), "intact");
}

/// As a user reads who may not open what has one name.
class WithoutTheRight : public archive::FileReading {
 public:
  explicit WithoutTheRight(std::string name) : name_(std::move(name)) {}
  int open_at(int folder, const std::string& name, int flags, const fs::path& path) const override {
    if (name != name_) return FileReading::open_at(folder, name, flags, path);
    errno = EACCES;
    return -1;
  }

 private:
  std::string name_;
};

TEST(WhatCannotBeRead, AccusesNobody) {
  const AttackedCase victim;
  const fs::path excerpt = victim.outside("excerpt");
  archive::ExcerptOptions part;
  part.to_ns = 3'000'000'000;
  part.streams = {"endoscope"};
  archive::make_excerpt(victim.folder(), part, excerpt);
  archive::VerifyOptions options = SoundCases::get().archive.options();
  for (const auto& [folder, name] :
       {std::pair(victim.folder(), "checkpoints"), std::pair(victim.folder(), "00000011.note"),
        std::pair(excerpt, "checkpoints"), std::pair(excerpt, "ledger-part.jsonl"),
        std::pair(excerpt, "ledger-open.jsonl")}) {
    const WithoutTheRight reading(name);
    options.files = &reading;
    const archive::VerificationReport report = archive::verify_case(folder, options);
    EXPECT_EQ(report.verdict, archive::Verdict::kUnproven) << folder << " " << name << details(report);
    EXPECT_THAT(summary(report), ::testing::HasSubstr("file-unreadable")) << name;
  }
}

TEST(SmugglingIntoAFolderThatCannotBeRead, IsNotPassedOver) {
  if (geteuid() == 0) {
    GTEST_SKIP() << "root may read everything";
  }
  AttackedCase victim;
  write_file(victim / "authorities/film.mp4", "x");
  fs::permissions(victim / "authorities", fs::perms::owner_read);  // names can be listed and not looked at
  const archive::VerificationReport report = victim.verify();
  fs::permissions(victim / "authorities", fs::perms::owner_all);
  EXPECT_NE(report.verdict, archive::Verdict::kIntact) << details(report);
  EXPECT_THAT(summary(report), ::testing::HasSubstr("file-unreadable authorities/film.mp4 -"));
}

}  // namespace
}  // namespace kiroku::test
