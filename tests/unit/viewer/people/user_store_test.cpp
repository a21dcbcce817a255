#include "viewer/people/user_store.h"

#include <sys/stat.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::viewer {
namespace {

using testing::ElementsAre;

/// Of salt and password, as scrypt; without its third of a second of a core.
crypto::Secret quickly(const crypto::Secret& password, ByteView salt, int /*cost*/) {
  const std::string key = crypto::to_hex(salt) + std::string(password.text());
  return crypto::Secret::copy_of(std::string_view(crypto::to_hex(crypto::sha256(bytes_of(key)))));
}

/// What does not depend on how passwords are hashed.
class Users : public testing::Test {
 protected:
  static crypto::Secret secret(std::string_view text) { return crypto::Secret::copy_of(text); }
  test::TemporaryFolder folder;
  std::unique_ptr<UserStore> users = UserStore::open(folder / "users.sqlite", quickly);
};

class UsersByScrypt : public Users {
 protected:
  UsersByScrypt() { users = UserStore::open(folder / "users.sqlite"); }
};

TEST_F(UsersByScrypt, SignInWithTheirPasswordAlone) {
  users->add("anna", Role::kSurgeon, secret("correct horse"));
  const auto anna = users->check("anna", secret("correct horse"));
  ASSERT_TRUE(anna);
  EXPECT_EQ(anna->role, Role::kSurgeon);
  EXPECT_FALSE(users->check("anna", secret("correct horsf")));
  EXPECT_FALSE(users->check("anna", secret("")));
  EXPECT_FALSE(users->check("bert", secret("correct horse")));
  EXPECT_FALSE(users->check("' OR 1=1 --", secret("correct horse")));
}

TEST_F(UsersByScrypt, AreInAFileThatOnlyItsOwnerReadsAndThatHoldsNoPassword) {
  users->add("anna", Role::kSurgeon, secret("correct horse"));
  struct stat status {};
  ASSERT_EQ(::stat((folder / "users.sqlite").c_str(), &status), 0);
  EXPECT_EQ(status.st_mode & 0777U, 0600U);
  std::ifstream file(folder / "users.sqlite", std::ios::binary);
  const std::string content(std::istreambuf_iterator<char>(file), {});
  EXPECT_NE(content.find("anna"), std::string::npos);
  EXPECT_EQ(content.find("correct horse"), std::string::npos);
}

TEST_F(UsersByScrypt, WithTheSamePasswordHaveDifferentHashes) {
  users->add("anna", Role::kSurgeon, secret("correct horse"));
  users->add("bert", Role::kSurgeon, secret("correct horse"));
  users->set_password("bert", secret("battery staple"));
  EXPECT_TRUE(users->check("anna", secret("correct horse")));
  EXPECT_FALSE(users->check("bert", secret("correct horse")));
  EXPECT_TRUE(users->check("bert", secret("battery staple")));
}

TEST_F(Users, AreListedChangedAndRemovedAlsoByAnotherProcess) {
  users->add("bert", Role::kOperator, secret("correct horse"));
  const auto other = UserStore::open(folder / "users.sqlite", quickly);
  other->add("anna", Role::kAuditor, secret("correct horse"));
  const UtcTime before = users->find("anna")->changed;
  other->set_role("anna", Role::kSurgeon);
  std::vector<std::string> names;
  for (const User& user : users->list()) names.push_back(user.name);
  EXPECT_THAT(names, ElementsAre("anna", "bert"));
  EXPECT_EQ(users->find("anna")->role, Role::kSurgeon);
  EXPECT_GT(users->find("anna")->changed, before);
  other->remove("anna");
  EXPECT_FALSE(users->find("anna"));
}

TEST_F(Users, HaveProperNamesAndPasswords) {
  for (const char* name :
       {"", "Anna", "-anna", "an na", "anna/", "ännä", "0123456789012345678901234567890123"}) {
    EXPECT_THROW(users->add(name, Role::kOperator, secret("correct horse")), UsageError) << name;
  }
  EXPECT_THROW(users->add("anna", Role::kOperator, secret("short")), UsageError);
  EXPECT_THROW(users->add("anna", Role::kOperator, secret("手術手術手術手術手")), UsageError);
  EXPECT_THROW(users->add("anna.berger", Role::kOperator, secret("anna.berger")), UsageError);
  EXPECT_THROW(users->add("anna", Role::kOperator, secret(std::string(1025, 'x'))), UsageError);
  EXPECT_THROW(users->add("anna", Role::kOperator, secret("\xff\xff\xff\xff\xff\xff\xff\xff\xff\xff")),
               UsageError);
  EXPECT_TRUE(users->list().empty());
}

TEST_F(Users, AreNotAddedTwiceNorChangedWhereTheyAreNot) {
  users->add("anna", Role::kOperator, secret("correct horse"));
  EXPECT_THROW(users->add("anna", Role::kSurgeon, secret("correct horse")), UsageError);
  EXPECT_THROW(users->set_password("bert", secret("correct horse")), UsageError);
  EXPECT_THROW(users->set_role("bert", Role::kSurgeon), UsageError);
  EXPECT_THROW(users->remove("bert"), UsageError);
}

TEST_F(Users, AlwaysHaveAnAdministratorAmongThem) {
  users->add("anna", Role::kAdministrator, secret("correct horse"));
  users->add("bert", Role::kSurgeon, secret("correct horse"));
  EXPECT_THROW(users->set_role("anna", Role::kSurgeon), UsageError);
  EXPECT_THROW(users->remove("anna"), UsageError);
  users->set_role("bert", Role::kAdministrator);
  users->set_role("anna", Role::kSurgeon);
  EXPECT_THROW(users->set_role("bert", Role::kOperator), UsageError) << "now the last one";
  users->remove("anna");
  users->remove("bert");
  EXPECT_THAT(users->list(), testing::IsEmpty()) << "whoever removes everybody begins anew";
}

TEST_F(Users, HaveAOneTimePasswordUntilTheyChooseTheirOwn) {
  users->add("anna", Role::kSurgeon, secret("correct horse"));
  EXPECT_FALSE(users->find("anna")->one_time_until);
  const crypto::Secret given = UserStore::new_one_time_password();
  EXPECT_NE(given.text(), UserStore::new_one_time_password().text());
  EXPECT_EQ(given.size(), 23U);
  const UtcTime until = utc_now() + std::chrono::hours(24);
  users->set_password("anna", given, until);
  EXPECT_FALSE(users->check("anna", secret("correct horse")));
  ASSERT_TRUE(users->check("anna", given));
  EXPECT_TRUE(users->check("anna", given)->one_time_until);
  const auto other = UserStore::open(folder / "users.sqlite", quickly);
  EXPECT_TRUE(other->list().front().one_time_until);
  other->set_password("anna", secret("battery staple"));
  EXPECT_FALSE(users->check("anna", secret("battery staple"))->one_time_until);
  users->set_password("anna", given, until);
  users->remove("anna");
  users->add("anna", Role::kSurgeon, secret("correct horse"));
  EXPECT_FALSE(users->find("anna")->one_time_until) << "nothing of who was removed";
}

}  // namespace
}  // namespace kiroku::viewer
