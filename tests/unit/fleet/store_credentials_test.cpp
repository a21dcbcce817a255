#include "fleet/store_credentials.h"

#include <fstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::fleet {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::ThrowsMessage;

class StoreCredentialsTest : public testing::Test {
 protected:
  fs::path written(const std::string& text, fs::perms mode = fs::perms::owner_read | fs::perms::owner_write) {
    const fs::path file = folder.path() / "store-credentials";
    std::ofstream(file, std::ios::binary) << text;
    fs::permissions(file, mode);
    return file;
  }
  const test::TemporaryFolder folder;
};

TEST_F(StoreCredentialsTest, AreTwoLinesInAnyOrder) {
  const StoreCredentials read =
      read_credentials(written("# of or-1\n\n  secret_key=s3/cr+et==  \r\naccess_key = or-1-key"));
  EXPECT_EQ(read.access_key, "or-1-key");
  EXPECT_EQ(read.secret_key.text(), "s3/cr+et==");
}

TEST_F(StoreCredentialsTest, ThatOthersCanReadAreRefused) {
  const fs::path file =
      written("access_key = a\nsecret_key = b\n", fs::perms::owner_read | fs::perms::group_read);
  EXPECT_THAT([&] { read_credentials(file); }, ThrowsMessage<UsageError>(HasSubstr("chmod 600")));
}

TEST_F(StoreCredentialsTest, ThatAreNotThereAreSaidToBeMissing) {
  EXPECT_THAT([&] { read_credentials(folder.path() / "none"); },
              ThrowsMessage<UsageError>(HasSubstr("there are no credentials in")));
}

TEST_F(StoreCredentialsTest, AnythingElseIsRefusedAndNeverRepeated) {
  for (const char* text :
       {"", "access_key = a\n", "secret_key = hidden\n", "access_key = a\nsecret_key = hid den\n",
        "access_key = a\nsecret_key = hidden\nsecret_key = hidden\n",
        "access_key = a:b\nsecret_key = hidden\n", "[store]\naccess_key = a\nsecret_key = hidden\n",
        "access_key = \xc3\xa9\nsecret_key = hidden\n", "hidden"}) {
    const fs::path file = written(text);
    EXPECT_THAT(
        [&] { read_credentials(file); },
        ThrowsMessage<UsageError>(AllOf(HasSubstr("is no file of credentials"), Not(HasSubstr("hidden")))))
        << text;
  }
  const fs::path file = written(std::string(5000, 'a'));
  EXPECT_THAT([&] { read_credentials(file); }, ThrowsMessage<UsageError>(HasSubstr("far too long")));
}

}  // namespace
}  // namespace kiroku::fleet
