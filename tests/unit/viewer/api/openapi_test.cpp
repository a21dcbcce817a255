#include "viewer/api/openapi.h"

#include <regex>
#include <set>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "crypto/signing_key.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/api.h"
#include "viewer/people/sign_in_link.h"

namespace kiroku::viewer {
namespace {

using nlohmann::json;

/// Every route of a viewer and of a hospital's page, on an empty home.
class OpenApi : public testing::Test {
 protected:
  OpenApi() {
    std::filesystem::create_directory(folder / "archive");
    ViewerHome home{.archive = folder / "archive",
                    .catalogue_file = folder / "catalogue.sqlite",
                    .log_folder = folder / "archive/log",
                    .users_file = folder / "users.sqlite",
                    .control_socket = folder / "control.sock",
                    .copies_folder = folder / "copies",
                    .handout_folder = folder / "files",
                    .device_key = &key,
                    .device = crypto::VerifierKey("or-3", key.public_key()),
                    .trust = &trust,
                    .identities = nullptr};
    context.emplace(std::move(home), SessionLimits{}, [](const std::string& /*sentence*/) {});
    add_routes(router, *context, link);
    add_stored_case_routes(router, *context);
    add_fleet_room_routes(router, *context);
  }

  /// "get /cases/{case}" and its right.
  [[nodiscard]] std::map<std::string, std::string> of_router() const {
    std::map<std::string, std::string> out;
    for (const Route* route : router.routes()) {
      std::string method = route->method;
      for (char& c : method) c = static_cast<char>(std::tolower(c));
      const std::string path =
          std::regex_replace(route->pattern.substr(3), std::regex(R"(\{(\w+):\w+\})"), "{$1}");
      out[method + " " + path] = std::string(right_name(route->right));
    }
    return out;
  }
  static std::map<std::string, std::string> of_document(const json& document) {
    std::map<std::string, std::string> out;
    for (const auto& [path, operations] : document["paths"].items()) {
      for (const auto& [method, operation] : operations.items()) {
        out[method + " " + path] = operation["x-right"];
      }
    }
    return out;
  }

  test::TemporaryFolder folder;
  crypto::SigningKey key = crypto::SigningKey::generate();
  timestamp::TrustStore trust;
  std::optional<ViewerContext> context;
  SignInLink link;
  Router router;
};

TEST_F(OpenApi, NamesEveryRouteWithItsRightAndNoOther) {
  EXPECT_EQ(of_document(json::parse(openapi_text())), of_router());
}

TEST_F(OpenApi, NamesEveryParameterOfAPathAndResolvesItsReferences) {
  const json document = json::parse(openapi_text());
  const std::regex braces(R"(\{(\w+)\})");
  for (const auto& [path, operations] : document["paths"].items()) {
    std::set<std::string> in_path;
    for (std::sregex_iterator each(path.begin(), path.end(), braces), end; each != end; ++each) {
      in_path.insert((*each)[1]);
    }
    for (const auto& [method, operation] : operations.items()) {
      std::set<std::string> described;
      for (const json& parameter : operation.value("parameters", json::array())) {
        if (parameter.value("in", "") == "path") described.insert(parameter["name"]);
      }
      EXPECT_EQ(described, in_path) << method << " " << path;
    }
  }
  const std::string text(openapi_text());
  const std::regex reference(R"re("\$ref": "#([^"]+)")re");
  for (std::sregex_iterator each(text.begin(), text.end(), reference), end; each != end; ++each) {
    EXPECT_TRUE(document.contains(json::json_pointer((*each)[1].str()))) << (*each)[1];
  }
}

TEST_F(OpenApi, SaysOfEverythingThatChangesSomethingWhichHeaderItNeeds) {
  const json document = json::parse(openapi_text());
  for (const auto& [path, operations] : document["paths"].items()) {
    for (const auto& [method, operation] : operations.items()) {
      const bool says_so =
          operation.dump().find("#/components/parameters/KirokuRequest") != std::string::npos;
      EXPECT_EQ(says_so, method != "get") << method << " " << path;
    }
  }
}

}  // namespace
}  // namespace kiroku::viewer
