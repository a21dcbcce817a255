#include "apps/kiroku/user_command.h"

#include <iostream>
#include <memory>

#include <nlohmann/json.hpp>

#include "apps/common/format.h"
#include "apps/common/json_output.h"
#include "apps/common/terminal.h"
#include "apps/kiroku/commands.h"
#include "apps/kiroku/home.h"
#include "base/error.h"
#include "viewer/people/user_store.h"

namespace kiroku::apps {
namespace {

using nlohmann::ordered_json;

const std::vector<std::string> kRoles{"operator", "surgeon", "auditor", "administrator"};

struct Request {
  std::optional<std::string> home, role;
  std::string name, new_role;
  bool json = false;
};

std::unique_ptr<viewer::UserStore> open_users(const Request& request) {
  return viewer::UserStore::open(Home::open(request.home).folder() / "users.sqlite");
}

int add(const Request& request) {
  const auto users = open_users(request);
  const viewer::Role role = *viewer::parse_role(request.role.value_or("operator"));
  if (users->find(request.name)) {
    throw UsageError("there is a user '" + request.name +
                     "' already: 'kiroku user password' or 'kiroku user role' "
                     "changes it");
  }
  users->add(request.name, role, ask_new_passphrase("the user " + request.name));
  std::cout << request.name << " may sign in as " << viewer::role_name(role) << ".\n";
  return kDone;
}

int set_password(const Request& request) {
  const auto users = open_users(request);
  if (!users->find(request.name)) {
    throw UsageError("there is no user '" + request.name + "': 'kiroku user list' names them");
  }
  users->set_password(request.name, ask_new_passphrase("the user " + request.name));
  std::cout << request.name << " has a new password and is signed out everywhere.\n";
  return kDone;
}

int set_role(const Request& request) {
  open_users(request)->set_role(request.name, *viewer::parse_role(request.new_role));
  std::cout << request.name << " is " << request.new_role << " from the next signing in.\n";
  return kDone;
}

int remove(const Request& request) {
  open_users(request)->remove(request.name);
  std::cout << request.name << " may no longer sign in.\n";
  return kDone;
}

int list(const Request& request) {
  const std::vector<viewer::User> users = open_users(request)->list();
  if (request.json) {
    ordered_json rows = ordered_json::array();
    for (const viewer::User& user : users) {
      rows.push_back({{"user", user.name},
                      {"role", viewer::role_name(user.role)},
                      {"changed", format_utc(user.changed)}});
    }
    print_json({{"users", rows}});
  } else if (users.empty()) {
    std::cout << "Nobody may sign in yet: add a user with 'kiroku user add NAME --role ROLE'.\n";
  } else {
    std::vector<std::vector<std::string>> rows{{"user", "role", "changed"}};
    for (const viewer::User& user : users) {
      rows.push_back({user.name, std::string(viewer::role_name(user.role)), format_local(user.changed)});
    }
    std::cout << format_table(rows, "lll", 0);
  }
  return kDone;
}

void add_user_argument(Command& command, const std::shared_ptr<Request>& request) {
  command.argument("NAME", request->name, "a-z, 0-9, '.', '_' and '-', at most 32 characters");
  add_home_option(command, request->home);
}

}  // namespace

void add_user_command(Command& program) {
  Command& user = program.add_command("user", "says who may sign in to the viewer");
  user.explain(
      "Roles: operator (list, live pictures, start, stop, mark), surgeon (also watch, verify and compare), "
      "auditor "
      "(verify, documents, the appliance log; no pictures), administrator (everything, and users).");
  user.example("kiroku user add anna --role surgeon", "asks for a password and adds a surgeon");

  Command& adding = user.add_command("add", "adds a user");
  const auto added = std::make_shared<Request>();
  add_user_argument(adding, added);
  adding.choice("--role", kRoles, added->role, "what the user may do", "operator");
  adding.explain(
      "The password is asked for twice, or taken from KIROKU_PASSPHRASE; at least 10 characters. The home "
      "keeps its "
      "scrypt hash alone.");
  adding.example("kiroku user add anna --role surgeon", "asks for a password and adds a surgeon");
  adding.on_run([added] { return add(*added); });

  Command& password = user.add_command("password", "gives a user another password");
  const auto changed = std::make_shared<Request>();
  add_user_argument(password, changed);
  password.explain("Whoever has signed in under the name is signed out within seconds.");
  password.example("kiroku user password anna", "asks for the new one");
  password.on_run([changed] { return set_password(*changed); });

  Command& role = user.add_command("role", "gives a user another role");
  const auto moved = std::make_shared<Request>();
  role.argument("NAME", moved->name, "a user");
  role.choice_argument("ROLE", kRoles, moved->new_role, "what the user may do");
  add_home_option(role, moved->home);
  role.example("kiroku user role anna administrator", "anna may do everything");
  role.on_run([moved] { return set_role(*moved); });

  Command& removing = user.add_command("remove", "removes a user");
  const auto removed = std::make_shared<Request>();
  add_user_argument(removing, removed);
  removing.explain("Whoever has signed in under the name is signed out within seconds.");
  removing.example("kiroku user remove anna", "anna may no longer sign in");
  removing.on_run([removed] { return remove(*removed); });

  Command& listing = user.add_command("list", "lists the users");
  const auto listed = std::make_shared<Request>();
  add_home_option(listing, listed->home);
  listing.flag("--json", listed->json, "prints one JSON object instead");
  listing.example("kiroku user list", "names and roles");
  listing.on_run([listed] { return list(*listed); });
}

}  // namespace kiroku::apps
