// A log that is published and followed, by the program that people run.
#include <filesystem>

#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class LogPublish : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    EXPECT_FALSE(record().empty());
  }
  [[nodiscard]] ProcessResult publish() const { return kiroku({"log", "publish", path("published")}); }
  [[nodiscard]] ProcessResult follow(const std::string& source) const {
    return kiroku({"log", "follow", source, path("copy"), "--device", (home() / "device.pub").string()});
  }
};

TEST_F(LogPublish, IsFollowedWithoutASecretLeaving) {
  const ProcessResult published = publish();
  EXPECT_EQ(published.status, 0) << published.out << published.err;
  EXPECT_THAT(published.out, HasSubstr("and nothing but their hashes"));
  EXPECT_THAT(follow(path("published")).out, HasSubstr("BEGUN: "));
  EXPECT_EQ(follow(path("published")).status, 0);
  EXPECT_FALSE(record().empty());
  EXPECT_THAT(follow(path("published")).out, HasSubstr("SAME: "));
  EXPECT_THAT(publish().out, HasSubstr("of them new"));
  EXPECT_THAT(publish().out, HasSubstr("nothing came since"));
  const ProcessResult followed = follow(path("published"));
  EXPECT_EQ(followed.status, 0) << followed.err;
  EXPECT_THAT(followed.out, HasSubstr("GOES ON: "));
  // What is published names no case and no user: hashes, and the checkpoint's three lines.
  for (const auto& each : fs::recursive_directory_iterator(path("published"))) {
    if (!each.is_regular_file()) continue;
    EXPECT_THAT(read_text(each.path()), Not(HasSubstr("case"))) << each.path();
  }
  const nlohmann::json told = kiroku_json({"log", "follow", path("published"), path("copy"), "--device",
                                           (home() / "device.pub").string(), "--json"});
  EXPECT_EQ(told["outcome"], "same");
  EXPECT_EQ(told["kept"], told["shown"]);
}

TEST_F(LogPublish, GoesOnThoughAnOldCheckpointLiesUnderALargeNumber) {
  EXPECT_EQ(publish().status, 0);
  const fs::path notes = home() / "archive/log/checkpoints";
  fs::copy(*fs::directory_iterator(notes), notes / "99999999.note");
  EXPECT_FALSE(record().empty());
  const ProcessResult published = publish();
  EXPECT_EQ(published.status, 0) << published.out << published.err;
  EXPECT_THAT(published.out, HasSubstr("of them new"));
  EXPECT_THAT(published.out, HasSubstr("checkpoints/99999999.note in the log's folder is no checkpoint"));
}

TEST_F(LogPublish, ABackupThatWentOnIsNotPublishedAndWhoeverFollowsSeesIt) {
  fs::copy(home(), folder() / "backup", fs::copy_options::recursive);
  EXPECT_FALSE(record().empty());
  EXPECT_EQ(publish().status, 0);
  EXPECT_EQ(follow(path("published")).status, 0);

  // As it was, and as it went on.
  const Arguments of_backup{"log", "publish", path("published"), "--home", path("backup")};
  ProcessResult refused = kiroku(of_backup);
  EXPECT_EQ(refused.status, 1) << refused.out << refused.err;
  EXPECT_THAT(refused.out, HasSubstr("its end was removed, or this home is a copy from before"));
  EXPECT_EQ(kiroku({"record", "--home", path("backup"), "--json", "--duration", "00:00:01", "--endoscope",
                    "synthetic:endoscope?size=64x48&rate=10&speed=max"})
                .status,
            0);
  refused = kiroku(of_backup);
  EXPECT_EQ(refused.status, 1) << refused.out;
  EXPECT_THAT(refused.out, HasSubstr("NOT PUBLISHED: "));

  // Shown to somebody else.
  EXPECT_EQ(kiroku({"log", "publish", path("other"), "--home", path("backup")}).status, 0);
  const ProcessResult told = follow(path("other"));
  EXPECT_EQ(told.status, 1) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("TWO HISTORIES: one device signed both"));
  EXPECT_THAT(told.out, HasSubstr("or went on from an older copy that was put back."));
  EXPECT_THAT(told.out, HasSubstr("The other one: " + path("copy") + "/forked-"));
  // That does not go away by what is shown later.
  const ProcessResult later = follow(path("published"));
  EXPECT_EQ(later.status, 1) << later.out;
  EXPECT_THAT(later.out, HasSubstr("ANOTHER HISTORY was shown here before"));
}

TEST_F(LogPublish, RefusesInASentence) {
  const ProcessResult nobody = kiroku({"log", "follow", path("published"), path("copy")});
  EXPECT_EQ(nobody.status, 2);
  EXPECT_THAT(nobody.err, HasSubstr("give --device"));
  const ProcessResult nothing = follow(path("published"));
  EXPECT_EQ(nothing.status, 2);
  EXPECT_THAT(nothing.err, HasSubstr("published"));
  fs::create_directory(folder() / "empty");
  const ProcessResult empty = follow(path("empty"));
  EXPECT_EQ(empty.status, 3);
  EXPECT_THAT(empty.out, HasSubstr("COULD NOT TELL: no log is published there"));
  EXPECT_EQ(publish().status, 0);
  EXPECT_EQ(kiroku({"init", "--demo", "--home", path("stranger")}).status, 0);
  const ProcessResult foreign =
      kiroku({"log", "follow", path("published"), path("copy"), "--device", path("stranger/device.pub")});
  EXPECT_EQ(foreign.status, 3);
  EXPECT_THAT(foreign.out, HasSubstr("not signed for the log of the device that was named"));
}

}  // namespace
}  // namespace kiroku::test
