// What the programs say of a configuration that trusts the network, or whose secrets lie open.
#include <filesystem>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

using testing::ContainsRegex;
using testing::HasSubstr;
using testing::Not;

class NetworkTrust : public ProgramTest {
 protected:
  void SetUp() override { make_demo_home(); }
  [[nodiscard]] ProcessResult check(const std::string& source) const {
    write_text(folder() / "k.toml",
               "[[room]]\nname = \"or-1\"\n[[room.stream]]\nname = \"vitals\"\nkind = \"vitals\"\n"
               "source = \"" +
                   source + "\"\n");
    return tool({built_file("kirokud"), "--home", home().string(), "--config", path("k.toml"), "--check"});
  }
};

TEST_F(NetworkTrust, ACheckAsksWhoMaySendVitalSigns) {
  const ProcessResult anybody = check("mllp://0.0.0.0:2575");
  EXPECT_EQ(anybody.status, 2);
  EXPECT_THAT(anybody.err, HasSubstr("say who may send with allow="));
  EXPECT_EQ(check("mllp://0.0.0.0:2575?allow=192.168.7.0/24").status, 0);
  EXPECT_EQ(check("mllp://0.0.0.0:2575?allow=any").status, 0);
  EXPECT_EQ(check("mllp://127.0.0.1:2575").status, 0);
  EXPECT_EQ(check("mllp://127.0.0.1:2575?locations=SURG^OR1,OR1").status, 0);
  EXPECT_EQ(check("mllp://127.0.0.1:2575?locations=").status, 2);
  EXPECT_EQ(check("mllp://127.0.0.1:2575?allow=192.168.7.1/24").status, 2);
}

TEST_F(NetworkTrust, RecordingAsksWhoMaySendVitalSigns) {
  const ProcessResult refused = kiroku({"record", "--vitals", "mllp://0.0.0.0:0", "--duration", "1s"});
  EXPECT_EQ(refused.status, 2);
  EXPECT_THAT(refused.err, HasSubstr("could be anybody on the network"));
}

TEST_F(NetworkTrust, TheDoctorFindsATokenThatLiesOpen) {
  write_text(home() / "hook-token", "a token of some length");
  write_text(home() / "kiroku.toml",
             read_text(home() / "kiroku.toml") + "\n[daemon]\nhook_token_file = \"hook-token\"\n");
  std::filesystem::permissions(home() / "hook-token", std::filesystem::perms(0640));
  EXPECT_THAT(kiroku({"doctor"}).out, ContainsRegex("BAD +hook token: .*hook-token can be read by others"));
  std::filesystem::permissions(home() / "hook-token", std::filesystem::perms(0600));
  EXPECT_THAT(kiroku({"doctor"}).out, Not(HasSubstr("hook token")));
}

}  // namespace
}  // namespace kiroku::test
