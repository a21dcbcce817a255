// What a copy of a machine's disks cannot name.
#include "fleet/reports/machine_run.h"

#include <filesystem>
#include <fstream>
#include <functional>
#include <optional>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "fleet/reports/report_client.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;

class MachineRun : public testing::Test {
 protected:
  void SetUp() override {
    std::string made = std::string(kMemoryFolder) + "/kiroku-test-XXXXXX";
    if (::mkdtemp(made.data()) == nullptr) GTEST_SKIP() << kMemoryFolder << " cannot be written to";
    memory_ = made;
  }
  void TearDown() override {
    if (!memory_.empty()) fs::remove_all(memory_);
  }
  [[nodiscard]] fs::path secret() const {
    for (const auto& entry : fs::directory_iterator(memory_)) return entry.path();
    return {};
  }
  /// What whoever has the disks can work out.
  [[nodiscard]] std::string of_disks() const {
    std::ifstream file("/proc/sys/kernel/random/boot_id");
    std::string boot;
    std::getline(file, boot);
    return crypto::to_hex(crypto::sha256(bytes_of(boot + " " + fs::canonical(home_.path()).string())))
        .substr(0, 32);
  }
  static fs::perms permissions(const fs::path& file) { return fs::status(file).permissions(); }

  const test::TemporaryFolder home_;
  fs::path memory_;
};

TEST_F(MachineRun, IsTheSameForAllWhoReportOfAHome) {
  const std::string run = run_of_machine(home_.path(), memory_);
  EXPECT_EQ(run.size(), 32U);
  EXPECT_EQ(run.find_first_not_of("0123456789abcdef"), std::string::npos);
  EXPECT_EQ(run_of_machine(home_.path(), memory_), run);
  EXPECT_EQ(run_of_machine(home_.path() / "." / "", memory_), run);
  const test::TemporaryFolder other;
  EXPECT_NE(run_of_machine(other.path(), memory_), run) << "two copies of a home on one machine are two";
}

TEST_F(MachineRun, CannotBeNamedByWhoeverCopiedTheDisks) {
  const std::string run = run_of_machine(home_.path(), memory_);
  EXPECT_NE(run, of_disks());
  EXPECT_EQ(permissions(secret()), fs::perms::owner_read | fs::perms::owner_write);
  // The machine starts anew, or is another one: nothing of memory is left.
  fs::remove(secret());
  EXPECT_NE(run_of_machine(home_.path(), memory_), run);
}

TEST_F(MachineRun, BelievesNoSecretThatAnotherUserPutThere) {
  const std::string run = run_of_machine(home_.path(), memory_);
  const fs::path file = secret();
  struct Case {
    const char* what;
    std::function<void()> put;
  };
  const Case cases[] = {
      {"readable by others", [&] { fs::permissions(file, fs::perms::others_read, fs::perm_options::add); }},
      {"of another length",
       [&] {
         std::ofstream(file) << "known";
         fs::permissions(file, fs::perms::owner_read | fs::perms::owner_write);
       }},
      {"a link", [&] { fs::create_symlink("/etc/hostname", file); }},
      {"a pipe", [&] { ASSERT_EQ(::mkfifo(file.c_str(), 0600), 0); }},
      {"a folder", [&] { fs::create_directory(file); }},
  };
  for (const Case& each : cases) {
    each.put();
    EXPECT_EQ(run_of_machine(home_.path(), memory_), of_disks()) << each.what;
    fs::remove_all(file);
  }
  EXPECT_NE(run_of_machine(home_.path(), memory_), run);
  if (::geteuid() != 0) return;
  ASSERT_EQ(::chown(secret().c_str(), 12345, static_cast<gid_t>(-1)), 0);
  EXPECT_EQ(run_of_machine(home_.path(), memory_), of_disks()) << "another user's";
}

TEST_F(MachineRun, OfRootIsTheOneOfTheHomesOwner) {
  if (::geteuid() != 0) GTEST_SKIP() << "only root can give a home away";
  ASSERT_EQ(::chown(home_.path().c_str(), 12345, static_cast<gid_t>(-1)), 0);
  run_of_machine(home_.path(), memory_);
  struct stat about {};
  ASSERT_EQ(::stat(secret().c_str(), &about), 0);
  EXPECT_EQ(about.st_uid, 12345U) << "the service could not read it";
}

TEST_F(MachineRun, WhereNothingLiesInMemoryFollowsFromTheBootIdentifier) {
  const fs::path nowhere = home_.path() / "none";
  EXPECT_EQ(run_of_machine(home_.path(), nowhere), of_disks());
}

// Two at one moment, by hand and by the service, could leave the certificate that does not count.
TEST(ReportingTurn, IsOneProcessesAtATime) {
  const test::TemporaryFolder home;
  const fs::path file = home.path() / "reporting.json";
  std::optional<ReportingTurn> first = ReportingTurn::take(file);
  ASSERT_TRUE(first);
  EXPECT_FALSE(ReportingTurn::take(file));
  const test::TemporaryFolder other;
  EXPECT_TRUE(ReportingTurn::take(other.path() / "reporting.json"));
  first.reset();
  EXPECT_TRUE(ReportingTurn::take(file));
}

}  // namespace
}  // namespace kiroku::fleet
