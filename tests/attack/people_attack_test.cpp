// Somebody who wants to know whom a case is about without its key, or to have a role or a password that
// nobody gave them: asks the server as a browser can, in every way that names patients or users.
#include <filesystem>
#include <fstream>
#include <future>
#include <sstream>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/storage/file_system.h"
#include "archive/writing/case_writer.h"
#include "crypto/age_file.h"
#include "crypto/hash.h"
#include "tests/support/flipped_byte.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/api.h"
#include "viewer/http/http_fields.h"
#include "viewer/http/static_files.h"
#include "viewer/people/sign_in_link.h"
#include "viewer/server/dispatcher.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;
namespace fs = std::filesystem;

constexpr const char* kPassword = "correct horse battery";

class PeopleAttack : public testing::Test {
 protected:
  PeopleAttack() {
    fs::create_directories(home / "archive");
    yamada = record("Yamada", a.recipient);
    suzuki = record("Suzuki", b.recipient);
    for (const auto& [name, role] : {std::pair{"anna", Role::kAdministrator},
                                     {"ben", Role::kAdministrator},
                                     {"sato", Role::kSurgeon},
                                     {"otto", Role::kOperator},
                                     {"audit", Role::kAuditor}}) {
      context.users().add(name, role, crypto::Secret::copy_of(std::string_view(kPassword)));
    }
    add_routes(router, context, link);
  }

  /// A closed case without pictures, about this patient, for this reader.
  std::string record(const std::string& patient, const std::string& recipient) {
    archive::CaseWriter::Options options;
    options.archive = home / "archive";
    options.key = &key;
    options.device_name = "test";
    options.boot_id = "6f1b1a52-4c9a-4d8c-9a3e-0f0e2f6f7a10";
    archive::StreamInfo info;
    info.name = info.purpose = info.kind = "events";
    info.media = "application/jsonl";
    info.profile = "jsonl";
    info.recipients = {recipient};
    options.streams.push_back(info);
    options.stream_recipients.push_back({crypto::parse_recipient(recipient)});
    options.subject = to_bytes(bytes_of(json{{"patient", {{"name", patient}}}}.dump()));
    options.subject_recipients = {crypto::parse_recipient(recipient)};
    const archive::Moment opened{*parse_utc("2026-08-05T09:15:02Z") + std::chrono::seconds(cases++), 0};
    return archive::CaseWriter::create(archive::real_file_system(), options, opened)
        ->folder()
        .filename()
        .string();
  }

  /// A browser: its session, and what it was answered last.
  struct Browser {
    std::string token;
    int status = 0;
    std::string text;
    Response response;
  };
  /// `meanwhile`: after the head was judged, while the body comes.
  void ask(Browser& browser, const std::string& method, const std::string& path, const json& body = {},
           const std::function<void()>& meanwhile = {}) {
    RequestHead head{method, path, "192.0.2.7", {{"host", "or-3"}}};
    if (!browser.token.empty()) head.headers["cookie"] = std::string(kSessionCookie) + "=" + browser.token;
    if (method != "GET") {
      head.headers["x-kiroku-request"] = "1";
      head.headers["content-type"] = "application/json";
    }
    Dispatcher::Admission admission = dispatcher.admit(std::move(head));
    if (meanwhile) meanwhile();
    if (method != "GET") admission.request.body = body.is_null() ? "{}" : body.dump();
    Response response = admission.refusal ? std::move(*admission.refusal) : dispatcher.answer(admission);
    while (response.costly) response = response.costly->work();
    browser.status = response.status;
    const auto* const text = std::get_if<std::string>(&response.body);
    browser.text = text != nullptr ? *text : "";
    browser.response = std::move(response);
  }
  Browser sign_in(const std::string& name, const std::string& password = kPassword) {
    Browser browser;
    ask(browser, "POST", "/api/session", {{"user", name}, {"password", password}});
    for (const auto& [field, value] : browser.response.headers) {
      const std::string begin = std::string(kSessionCookie) + "=";
      if (field == "Set-Cookie" && value.starts_with(begin)) {
        browser.token = value.substr(begin.size(), value.find(';') - begin.size());
      }
    }
    return browser;
  }
  void unlock(Browser& browser, const crypto::AgeKeyPair& reader) {
    ask(browser, "POST", "/api/session/unlock", {{"identity", std::string(reader.identity_text.text())}});
    ASSERT_LT(browser.status, 300) << browser.text;
  }
  std::string search(Browser& browser, const std::string& text) {
    ask(browser, "POST", "/api/cases/search", {{"search", text}});
    return browser.text;
  }
  static std::size_t found(const std::string& answer) { return json::parse(answer)["cases"].size(); }
  /// Everything that a log keeps.
  std::string logs() {
    std::ostringstream out;
    for (const auto& file : fs::recursive_directory_iterator(home / "log")) {
      if (file.is_regular_file()) out << std::ifstream(file.path(), std::ios::binary).rdbuf();
    }
    for (const std::string& sentence : told) out << sentence << "\n";
    return out.str();
  }
  /// As an administrator gives it.
  std::string one_time_password(const std::string& user) {
    Browser anna = sign_in("anna");
    ask(anna, "POST", "/api/users/" + user + "/password");
    EXPECT_EQ(anna.status, 200) << anna.text;
    return json::parse(anna.text)["password"];
  }
  Role role_of(const std::string& user) { return context.users().find(user)->role; }

  test::TemporaryFolder home;
  test::MovedClock clock;
  crypto::SigningKey key = crypto::SigningKey::generate();
  crypto::AgeKeyPair a = crypto::generate_age_key(), b = crypto::generate_age_key();
  std::string yamada, suzuki;
  int cases = 0;
  std::vector<std::string> told;
  ViewerContext context{ViewerHome{.archive = home / "archive",
                                   .catalogue_file = home / "catalogue.sqlite",
                                   .log_folder = home / "log",
                                   .users_file = home / "users.sqlite",
                                   .control_socket = home / "control",
                                   .copies_folder = home / "copies",
                                   .handout_folder = home / "handout",
                                   .device_key = &key,
                                   .device = crypto::VerifierKey("test", key.public_key()),
                                   .identities = {},
                                   .password_hasher =
                                       [](const crypto::Secret& password, ByteView salt, int /*cost*/) {
                                         crypto::Sha256 hash;
                                         hash.update(password.bytes());
                                         hash.update(salt);
                                         return crypto::Secret::copy_of(hash.finish());
                                       },
                                   .clock = &clock},
                        SessionLimits{}, [this](const std::string& sentence) { told.push_back(sentence); }};
  SignInLink link;
  Router router;
  StaticFiles page;
  Dispatcher dispatcher{router, context.sessions(), page,
                        [this](const std::string& sentence) { told.push_back(sentence); }};
};

TEST_F(PeopleAttack, SubjectsAreGivenForTheKeyAlone) {
  Browser sato = sign_in("sato");
  EXPECT_THAT(search(sato, ""), Not(HasSubstr("Yamada")));
  EXPECT_EQ(found(search(sato, "yamada")), 0U);
  ask(sato, "GET", "/api/cases/" + yamada + "/subject");
  EXPECT_EQ(sato.status, 423) << sato.text;

  unlock(sato, a);
  EXPECT_THAT(search(sato, ""), testing::AllOf(HasSubstr("Yamada"), Not(HasSubstr("Suzuki"))));
  EXPECT_EQ(found(search(sato, "yamada")), 1U);
  EXPECT_EQ(found(search(sato, "suzuki")), 0U) << "of a case that another key opens";
  ask(sato, "GET", "/api/cases/" + suzuki + "/subject");
  EXPECT_EQ(json::parse(sato.text)["state"], "not-yours");
  EXPECT_THAT(json::parse(sato.text)["subjects"], IsEmpty());

  ask(sato, "DELETE", "/api/session/unlock");
  EXPECT_THAT(search(sato, ""), Not(HasSubstr("Yamada"))) << "what was read is gone with the key";
  ask(sato, "GET", "/api/cases/" + yamada + "/subject");
  EXPECT_EQ(sato.status, 423);
}

TEST_F(PeopleAttack, SubjectsPassFromNoSessionToAnother) {
  Browser first = sign_in("sato");
  unlock(first, a);
  ASSERT_EQ(found(search(first, "yamada")), 1U);
  Browser second = sign_in("sato");
  Browser other = sign_in("ben");
  unlock(other, b);
  for (Browser* browser : {&second, &other}) {
    EXPECT_EQ(found(search(*browser, "yamada")), 0U);
    EXPECT_THAT(search(*browser, ""), Not(HasSubstr("Yamada")));
  }
  // One browser that changes hands.
  unlock(first, b);
  EXPECT_EQ(found(search(first, "yamada")), 0U);
  EXPECT_EQ(found(search(first, "suzuki")), 1U);
}

TEST_F(PeopleAttack, SubjectsAreGivenToNoRoleThatWatchesNothing) {
  for (const char* name : {"otto", "audit"}) {
    Browser browser = sign_in(name);
    ask(browser, "POST", "/api/session/unlock", {{"identity", std::string(a.identity_text.text())}});
    EXPECT_EQ(browser.status, 403) << name;
    EXPECT_EQ(json::parse(search(browser, "yamada"))["cases"].size(), 0U) << name;
    ask(browser, "GET", "/api/cases/" + yamada + "/subject");
    EXPECT_EQ(browser.status, 403) << name;
  }
  Browser stranger;
  search(stranger, "yamada");
  EXPECT_EQ(stranger.status, 401);
}

TEST_F(PeopleAttack, ASearchDoesNothingMoreForANameThatIsThere) {
  // Time would tell what work tells: without a key no sealed file is opened, so that whether the name is
  // there makes no difference. It is seen by taking the sealed files away.
  for (const std::string& id : {yamada, suzuki}) {
    for (const auto& file : fs::directory_iterator(home / "archive" / id)) {
      if (file.path().filename().string().starts_with("subject")) fs::remove(file.path());
    }
  }
  Browser sato = sign_in("sato");
  const json locked = json::parse(search(sato, "yamada"));
  EXPECT_EQ(locked["unread"], 0) << "nothing was tried";
  EXPECT_EQ(locked["subjects"], "locked");
  EXPECT_EQ(search(sato, "yamada").size(), search(sato, "nobody").size());
  unlock(sato, a);
  const json unlocked = json::parse(search(sato, ""));
  EXPECT_EQ(unlocked["cases"][0]["subject_state"], "problem") << "only now it was looked for";
}

TEST_F(PeopleAttack, SubjectsStayInNoCacheAndNoLog) {
  Browser sato = sign_in("sato");
  unlock(sato, a);
  for (const bool of_case : {false, true}) {
    if (of_case) {
      ask(sato, "GET", "/api/cases/" + yamada + "/subject");
    } else {
      search(sato, "yamada");
    }
    ASSERT_THAT(sato.text, HasSubstr("Yamada"));
    EXPECT_EQ(sato.response.cache, "no-store");
  }
  EXPECT_THAT(logs(), HasSubstr("listed patients, procedures and staff"));
  EXPECT_THAT(logs(), HasSubstr("read patient, procedure and staff"));
  EXPECT_THAT(logs(), Not(HasSubstr("amada")));
  std::ostringstream catalogue;
  catalogue << std::ifstream(home / "catalogue.sqlite", std::ios::binary).rdbuf();
  EXPECT_THAT(catalogue.str(), Not(HasSubstr("amada")));
}

TEST_F(PeopleAttack, AChangedSubjectIsNotShown) {
  for (const auto& file : fs::directory_iterator(home / "archive" / yamada)) {
    if (!file.path().filename().string().starts_with("subject")) continue;
    const Bytes other = crypto::seal_bytes(bytes_of(R"({"patient":{"name":"Nobody"}})"),
                                           {crypto::parse_recipient(a.recipient)});
    std::ofstream(file.path(), std::ios::binary | std::ios::trunc) << text_of(other);
  }
  Browser sato = sign_in("sato");
  unlock(sato, a);
  EXPECT_THAT(search(sato, ""), Not(HasSubstr("Nobody")));
  ask(sato, "GET", "/api/cases/" + yamada + "/subject");
  EXPECT_EQ(sato.status, 422);
  EXPECT_THAT(sato.text, HasSubstr("is not what the ledger says"));
}

TEST_F(PeopleAttack, ASubjectThatIsChangedInPlaceIsNotShownAsItWasReadBefore) {
  Browser sato = sign_in("sato");
  unlock(sato, a);
  EXPECT_THAT(search(sato, ""), HasSubstr("Yamada"));
  for (const auto& file : fs::directory_iterator(home / "archive" / yamada)) {
    if (!file.path().filename().string().starts_with("subject")) continue;
    // As many bytes as before: neither the ledger nor a size tells of it.
    test::flip_byte(file.path(), -1);
  }
  const std::string found = search(sato, "");
  EXPECT_THAT(found, Not(HasSubstr("Yamada")));
  EXPECT_THAT(found, HasSubstr(R"("subject_state":"problem")"));
  ask(sato, "GET", "/api/cases/" + yamada + "/subject");
  EXPECT_EQ(sato.status, 422) << sato.text;
}

TEST_F(PeopleAttack, AOneTimePasswordWorksOnce) {
  const std::string given = one_time_password("sato");
  EXPECT_EQ(sign_in("sato").status, 401) << "the old one is void";
  Browser owner = sign_in("sato", given);
  ASSERT_EQ(owner.status, 200);
  EXPECT_EQ(sign_in("sato", given).status, 403) << "who finds it afterwards";

  // Nothing but choosing another.
  for (const char* path : {"/api/cases", "/api/status", "/api/openapi.json", "/api/live"}) {
    ask(owner, "GET", path);
    EXPECT_EQ(owner.status, 403) << path;
  }
  ask(owner, "POST", "/api/session/unlock", {{"identity", std::string(a.identity_text.text())}});
  EXPECT_EQ(owner.status, 403);
  ask(owner, "POST", "/api/session/password", {{"password", given}, {"new_password", given}});
  EXPECT_EQ(owner.status, 400) << "the same is not another";
  ask(owner, "POST", "/api/session/password", {{"password", given}, {"new_password", "short"}});
  EXPECT_EQ(owner.status, 400);
  ask(owner, "POST", "/api/session/password",
      {{"password", "not the password"}, {"new_password", "battery staple"}});
  EXPECT_EQ(owner.status, 403);
  ask(owner, "POST", "/api/session/password", {{"password", given}, {"new_password", "battery staple"}});
  ASSERT_EQ(owner.status, 200) << owner.text;
  EXPECT_EQ(sign_in("sato", given).status, 401);
  EXPECT_EQ(sign_in("sato", "battery staple").status, 200);
}

TEST_F(PeopleAttack, OfTwoAtOnceOneComesInByAOneTimePassword) {
  const std::string given = one_time_password("sato");
  const UtcTime changed = context.users().find("sato")->changed;
  const auto other = UserStore::open(home / "users.sqlite");
  std::vector<std::future<bool>> tries;
  for (int i = 0; i < 8; ++i) {
    UserStore& store = i % 2 == 0 ? context.users() : *other;
    tries.push_back(
        std::async(std::launch::async, [&store, changed] { return store.use_one_time("sato", changed); }));
  }
  int in = 0;
  for (auto& each : tries) in += each.get() ? 1 : 0;
  EXPECT_EQ(in, 1);
  EXPECT_EQ(sign_in("sato", given).status, 403);
}

TEST_F(PeopleAttack, AOneTimePasswordExpires) {
  const std::string given = one_time_password("sato");
  clock.move(23h);
  const std::string later = one_time_password("otto");
  clock.move(61min);
  EXPECT_EQ(sign_in("sato", given).status, 403) << "after a day";
  Browser otto = sign_in("otto", later);
  EXPECT_EQ(otto.status, 200);
  clock.move(25min);
  ask(otto, "GET", "/api/session");
  ASSERT_EQ(otto.status, 200);

  // Signed in in time, and then left standing: it is over for choosing, too.
  const std::string left = one_time_password("audit");
  context.users().set_password("audit", crypto::Secret::copy_of(std::string_view(left)), clock.utc() - 1s);
  const SessionStore::Opened opened =
      context.sessions().open("audit", Role::kAuditor, context.users().find("audit")->changed, true);
  Browser audit;
  audit.token = opened.token;
  ask(audit, "POST", "/api/session/password", {{"password", left}, {"new_password", "battery staple"}});
  EXPECT_EQ(audit.status, 403) << audit.text;
}

TEST_F(PeopleAttack, AOneTimePasswordIsInNoLogAndNoList) {
  const std::string given = one_time_password("sato");
  Browser sato = sign_in("sato", given);
  ASSERT_EQ(sato.status, 200);
  ask(sato, "POST", "/api/session/password",
      {{"password", "wrong password"}, {"new_password", "battery staple"}});
  ask(sato, "POST", "/api/session/password", {{"password", given}, {"new_password", "battery staple"}});
  ASSERT_EQ(sato.status, 200);
  Browser anna = sign_in("anna");
  ask(anna, "GET", "/api/users");
  EXPECT_THAT(anna.text, Not(HasSubstr(given)));
  ask(anna, "GET", "/api/log");
  EXPECT_THAT(anna.text, HasSubstr("resets the password of user sato"));
  EXPECT_THAT(logs(), testing::AllOf(Not(HasSubstr(given)), Not(HasSubstr("battery staple"))));
  std::ostringstream users;
  users << std::ifstream(home / "users.sqlite", std::ios::binary).rdbuf();
  EXPECT_THAT(users.str(), Not(HasSubstr(given)));
}

TEST_F(PeopleAttack, NobodyRaisesThemselves) {
  for (const char* name : {"sato", "otto", "audit"}) {
    Browser browser = sign_in(name);
    const Role before = role_of(name);
    ask(browser, "POST", std::string("/api/users/") + name + "/role", {{"role", "administrator"}});
    EXPECT_EQ(browser.status, 403) << name;
    ask(browser, "POST", "/api/users", {{"user", name}, {"role", "administrator"}});
    EXPECT_EQ(browser.status, 403) << name;
    ask(browser, "POST", "/api/users",
        {{"user", "helper"}, {"password", kPassword}, {"role", "administrator"}});
    EXPECT_EQ(browser.status, 403) << name;
    ask(browser, "POST", "/api/users/anna/password");
    EXPECT_EQ(browser.status, 403) << name;
    ask(browser, "POST", "/api/session/password",
        {{"password", kPassword},
         {"new_password", "battery staple"},
         {"role", "administrator"},
         {"user", "anna"}});
    EXPECT_EQ(browser.status, 200) << name << ": their own, and nothing else of it counts";
    EXPECT_EQ(role_of(name), before);
    EXPECT_EQ(sign_in("anna").status, 200) << "whose password is as it was";
  }
}

TEST_F(PeopleAttack, TheLastAdministratorStays) {
  Browser anna = sign_in("anna");
  for (const char* how : {"role", "password"}) {
    ask(anna, "POST", std::string("/api/users/anna/") + how, {{"role", "surgeon"}});
    EXPECT_EQ(anna.status, 409) << "nobody their own";
  }
  ask(anna, "POST", "/api/users", {{"user", "anna"}, {"role", "surgeon"}});
  EXPECT_EQ(anna.status, 409);
  ask(anna, "DELETE", "/api/users/anna");
  EXPECT_EQ(anna.status, 409);
  Browser ben = sign_in("ben");
  ask(anna, "POST", "/api/users/ben/role", {{"role", "surgeon"}});
  EXPECT_EQ(anna.status, 200);
  // His session ended with his role.
  ask(ben, "POST", "/api/users/anna/role", {{"role", "surgeon"}});
  EXPECT_EQ(ben.status, 401);
  EXPECT_THROW(context.users().set_role("anna", Role::kSurgeon), UsageError);
  EXPECT_THROW(context.users().remove("anna"), UsageError);
  EXPECT_EQ(role_of("anna"), Role::kAdministrator);
}

TEST_F(PeopleAttack, WhoIsRemovedWhileTheirRequestComesDoesNothing) {
  struct Deed {
    const char* path;
    json body;
  };
  const std::vector<Deed> deeds{
      {"/api/users", {{"user", "ghost"}, {"password", kPassword}, {"role", "administrator"}}},
      {"/api/users/anna/password", json::object()},
      {"/api/users/anna/role", {{"role", "operator"}}},
      {"/api/users/sato/role", {{"role", "administrator"}}}};
  for (const Deed& deed : deeds) {
    for (const bool is_removed_by_hand : {false, true}) {
      context.users().add("mallory", Role::kAdministrator,
                          crypto::Secret::copy_of(std::string_view(kPassword)));
      Browser mallory = sign_in("mallory");
      ask(mallory, "POST", deed.path, deed.body, [&] {
        if (is_removed_by_hand) {
          // As 'kiroku users' does, of which sessions hear later.
          context.users().remove("mallory");
          return;
        }
        Browser anna = sign_in("anna");
        ask(anna, "DELETE", "/api/users/mallory");
        EXPECT_EQ(anna.status, 204);
      });
      EXPECT_EQ(mallory.status, 401) << deed.path << ": " << mallory.text;
    }
  }
  EXPECT_FALSE(context.users().find("ghost"));
  EXPECT_EQ(role_of("anna"), Role::kAdministrator);
  EXPECT_NE(role_of("sato"), Role::kAdministrator);
  EXPECT_EQ(sign_in("anna").status, 200) << "whose password is as it was";
}

TEST_F(PeopleAttack, TwoAdministratorsDoNotDemoteEachOther) {
  const auto other = UserStore::open(home / "users.sqlite");
  for (int round = 0; round < 20; ++round) {
    const auto demote = [](UserStore& store, const char* name) {
      try {
        store.set_role(name, Role::kSurgeon);
      } catch (const UsageError&) {
        // The one who came second.
      }
    };
    auto first = std::async(std::launch::async, [&] { demote(context.users(), "anna"); });
    auto second = std::async(std::launch::async, [&] { demote(*other, "ben"); });
    first.get();
    second.get();
    const bool anna_stays = role_of("anna") == Role::kAdministrator;
    EXPECT_TRUE(anna_stays != (role_of("ben") == Role::kAdministrator)) << "one, and one alone";
    context.users().set_role(anna_stays ? "ben" : "anna", Role::kAdministrator);
  }
}

}  // namespace
}  // namespace kiroku::viewer
