// Matching by hand as handlers answer it, with a script in the place of `kiroku`.
#include "viewer/api/matching_api.h"

#include <fstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/storage/file_system.h"
#include "archive/writing/case_writer.h"
#include "crypto/encoding.h"
#include "tests/support/eventually.h"
#include "tests/support/temporary_folder.h"
#include "viewer/api/alignment_fields.h"

namespace kiroku::viewer {
namespace {

using namespace std::chrono_literals;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;
namespace fs = std::filesystem;

class MatchingApiTest : public testing::Test {
 protected:
  MatchingApiTest() {
    const std::string seal = R"({"format": "a seal"})";
    fs::create_directories(folder_ / "plans/liver");
    std::ofstream(folder_ / "plans/liver/liver.seal.json") << seal;
    case_ = record(crypto::sha256(bytes_of(seal)));
    fs::create_directory(folder_ / "comparisons");
  }
  /// A case without segments, recorded by that plan.
  std::string record(const std::optional<crypto::Sha256Digest>& plan) {
    archive::CaseWriter::Options options;
    options.archive = folder_ / "archive";
    fs::create_directories(options.archive);
    options.key = &key_;
    options.device_name = "test";
    options.boot_id = "6f1b1a52-4c9a-4d8c-9a3e-0f0e2f6f7a10";
    options.plan = plan;
    for (const char* name : {"fluoroscopy", "vitals"}) {
      archive::StreamInfo info;
      info.name = info.purpose = name;
      info.kind = info.name == "vitals" ? "vitals" : "video";
      info.media = info.name == "vitals" ? "application/jsonl" : "video/mp2t";
      info.source = "synthetic:x";
      info.profile = info.name == "vitals" ? "jsonl" : "mpeg2";
      info.recipients = {reader_.recipient};
      options.streams.push_back(info);
      options.stream_recipients.push_back({crypto::parse_recipient(reader_.recipient)});
    }
    const archive::Moment opened{*parse_utc("2026-08-05T09:15:02Z") + std::chrono::seconds(cases_++), 0};
    return archive::CaseWriter::create(archive::real_file_system(), options, opened)
        ->folder()
        .filename()
        .string();
  }
  /// With `script` in the place of kiroku; none where it is empty.
  void serve(const std::string& script, std::chrono::milliseconds reading = 300ms) {
    fs::path program;
    if (!script.empty()) {
      program = folder_ / "program";
      std::ofstream(program) << "#!/bin/sh\n" << script << "\n";
      fs::permissions(program, fs::perms::owner_all);
    }
    fs::create_directories(folder_ / "home");
    context_.emplace(ViewerHome{.archive = folder_ / "archive",
                                .catalogue_file = folder_ / "catalogue.sqlite",
                                .log_folder = folder_ / "log",
                                .users_file = folder_ / "users.sqlite",
                                .control_socket = folder_ / "control",
                                .copies_folder = folder_ / "copies",
                                .comparisons_folder = folder_ / "comparisons",
                                .folder = folder_ / "home",
                                .plans_folder = folder_ / "plans",
                                .comparison_program = program,
                                .device_key = &key_,
                                .device = crypto::VerifierKey("test", key_.public_key()),
                                .identities = {}},
                     SessionLimits{}, [](const std::string&) {});
    router_.emplace();
    add_matching_routes(*router_, *context_, {.reading = reading, .making = 1min});
  }
  Response ask(const std::string& method, const std::string& below, const json& body = {}) {
    std::vector<std::string> segments{"api", "cases", case_};
    std::istringstream path(below);
    for (std::string part; std::getline(path, part, '/');) segments.push_back(part);
    const Router::Match match = router_->match(method, segments);
    if (match.route == nullptr) return Response::error(404, "no such address");
    Request request;
    request.method = method;
    request.parameters = match.parameters;
    request.session = session_;
    request.peer = "192.0.2.7";
    request.body = body.is_string() ? body.get<std::string>() : body.dump();
    try {
      return match.route->handler(request);
    } catch (const Refusal& refusal) {
      return Response::error(refusal.status(), refusal.what());
    }
  }
  void unlock() { session_->unlock(std::make_shared<const crypto::AgeIdentities>()); }
  static std::string text_of(const Response& response) { return std::get<std::string>(response.body); }
  /// Waits for the end of what is being made.
  json ended() {
    json made;
    EXPECT_TRUE(test::eventually([&] {
      const Response state = ask("GET", "making");
      if (state.status == 200) made = json::parse(text_of(state));
      return state.status == 200;
    }));
    return made;
  }
  /// A picture of the plan is asked for until it is there.
  Response pick(const char* what, const json& body) {
    Response response = Response::error(202, "never ready");
    EXPECT_TRUE(test::eventually([&] {
      response = ask("POST", std::string("picking/") + what, body);
      return response.status != 202;
    }));
    return response;
  }

  test::TemporaryFolder folder_;
  crypto::SigningKey key_ = crypto::SigningKey::generate();
  crypto::AgeKeyPair reader_ = crypto::generate_age_key();
  std::shared_ptr<Session> session_ =
      std::make_shared<Session>("haru", Role::kSurgeon, std::nullopt, Clock::system().now() + 1h);
  int cases_ = 0;
  std::string case_;
  std::optional<ViewerContext> context_;
  std::optional<Router> router_;
};

TEST_F(MatchingApiTest, EveryAddressIsForWhomMayCompareAndForTheUnlocked) {
  serve("exit 1");
  for (const Route* route : router_->routes()) EXPECT_EQ(route->right, Right::kCompare) << route->pattern;
  EXPECT_EQ(ask("GET", "matching").status, 423);
  EXPECT_EQ(ask("POST", "comparisons", {{"name", "x"}, {"by_hand", json::object()}}).status, 423);
  for (const char* what : {"picture", "point", "registration"})
    EXPECT_EQ(ask("POST", std::string("picking/") + what, json::object()).status, 423) << what;
}

TEST_F(MatchingApiTest, AForgedCaseAndOneWithoutAPlanAreRefusedBeforeAnythingRuns) {
  serve("touch " + (folder_ / "ran").string());
  unlock();
  const std::string real = case_;
  for (const char* forged : {"20260805T091502Z-ffffffff", "../../etc", "x"}) {
    case_ = forged;
    EXPECT_EQ(ask("POST", "picking/point", json::object()).status, 404) << forged;
    EXPECT_EQ(ask("GET", "matching").status, 404) << forged;
  }
  case_ = record({});
  EXPECT_THAT(text_of(ask("POST", "picking/point", json::object())),
              HasSubstr("not recorded by a sealed plan"));
  case_ = record(crypto::Sha256Digest{});
  EXPECT_THAT(text_of(ask("POST", "picking/point", json::object())), HasSubstr("put its folder into"));
  case_ = real;
  EXPECT_EQ(ask("POST", "picking/point", "no json").status, 400);
  EXPECT_EQ(ask("POST", "picking/anything", json::object()).status, 404);
  EXPECT_FALSE(fs::exists(folder_ / "ran"));
  serve("");
  EXPECT_EQ(ask("POST", "picking/point", json::object()).status, 503) << "nothing is installed";
}

TEST_F(MatchingApiTest, ARequestWaitsNoLongerThanItsLimit) {
  serve("exec sleep 100");
  unlock();
  const auto begin = std::chrono::steady_clock::now();
  const Response answer = ask("GET", "matching");
  EXPECT_EQ(answer.status, 504);
  EXPECT_THAT(text_of(answer), HasSubstr("took longer than"));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 100s) << "its end was not waited for";
}

TEST_F(MatchingApiTest, AServerThatEndsWaitsForNoPlan) {
  serve("touch '" + (folder_ / "begun").string() + "'\nexec sleep 100", 1min);
  unlock();
  const std::jthread ending([this] {
    EXPECT_TRUE(test::eventually([this] { return fs::exists(folder_ / "begun"); }));
    context_->close();
  });
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_EQ(ask("GET", "matching").status, 422);
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 1min) << "nor was its limit";
}

TEST_F(MatchingApiTest, QuestionsGoToTheProgramAndItsRefusalsComeBack) {
  serve(R"(test "$1 $2" = "plan pick" || exit 2
echo ready
while read -r line; do
  case "$line" in
    *'"point"'*'"x":0.5'*) echo '{"organ":[1,2,3]}';;
    *'"point"'*) echo '{"refused":"x is missing"}';;
    *) echo nonsense;;
  esac
done)");
  unlock();
  const Response first = ask("POST", "picking/point", {{"x", 0.5}});
  EXPECT_EQ(first.status, 202);
  EXPECT_EQ(json::parse(text_of(first)), json::parse(R"({"doing": "", "share": null})"));
  const Response point = pick("point", {{"x", 0.5}});
  EXPECT_EQ(point.status, 200) << text_of(point);
  EXPECT_EQ(text_of(point), R"({"organ":[1,2,3]})");
  const Response refused = pick("point", json::object());
  EXPECT_EQ(refused.status, 400);
  EXPECT_THAT(text_of(refused), HasSubstr("x is missing"));
  EXPECT_EQ(pick("picture", json::object()).status, 422);
  // What the body says is one question's value, whatever it holds.
  EXPECT_EQ(pick("registration", {{"point", {{"x", 0.5}}}, {"x", 0.5}, {"a\nb", "\n"}}).status, 200);
  // Another file in the plan's place is not taken for it.
  std::ofstream(folder_ / "plans/liver/liver.seal.json") << "{}";
  EXPECT_EQ(ask("POST", "picking/point", {{"x", 0.5}}).status, 404);
}

TEST_F(MatchingApiTest, AFluoroscopyIsNamedToTheProgramWithItsGeometry) {
  serve(R"(echo "$@" > )" + (folder_ / "asked").string() + R"(; cat /dev/fd/4 > )" +
        (folder_ / "geometry").string() + "; cat > " + (folder_ / "by_hand").string());
  unlock();
  const json geometry{{"sad_mm", 1000}};
  const auto said = [&](const json& fluoroscopy) {
    return json{{"name", "xray"}, {"by_hand", {{"steps", json::array()}}}, {"fluoroscopy", fluoroscopy}};
  };
  const Response begun = ask("POST", "comparisons",
                             said({{"stream", "fluoroscopy"},
                                   {"geometry", geometry},
                                   {"align_at_ns", 3'723'000'000'004},
                                   {"polarity", "bone-white"}}));
  ASSERT_EQ(begun.status, 202) << text_of(begun);
  EXPECT_EQ(ended()["state"], "done");
  const auto file = [&](const char* name) {
    std::ifstream in(folder_ / name);
    return std::string{std::istreambuf_iterator<char>(in), {}};
  };
  EXPECT_THAT(file("asked"),
              HasSubstr(" --geometry /dev/fd/4 --fluoroscopy fluoroscopy --polarity bone-white "
                        "--align-at 01:02:03.000000004\n"));
  EXPECT_EQ(json::parse(file("geometry")), geometry);
  EXPECT_EQ(json::parse(file("by_hand")), json::parse(R"({"steps": []})"));

  const auto refused = [&](const json& fluoroscopy) {
    const Response answer = ask("POST", "comparisons", said(fluoroscopy));
    EXPECT_EQ(answer.status, 400) << text_of(answer);
    return text_of(answer);
  };
  EXPECT_THAT(refused("x"), HasSubstr("must be an object"));
  EXPECT_THAT(refused({{"geometry", geometry}}), HasSubstr("'stream'"));
  EXPECT_THAT(refused({{"stream", "--made-by"}, {"geometry", geometry}}), HasSubstr("no stream of pictures"));
  EXPECT_THAT(refused({{"stream", "vitals"}, {"geometry", geometry}}), HasSubstr("no stream of pictures"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}}), HasSubstr("'geometry'"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}, {"geometry", "/etc/passwd"}}), HasSubstr("'geometry'"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}, {"geometry", geometry}, {"polarity", "x"}}),
              HasSubstr("bone-black"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}, {"geometry", geometry}, {"align_at_ns", -1}}),
              HasSubstr("'align_at_ns'"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}, {"geometry", geometry}, {"align_at_ns", "now"}}),
              HasSubstr("'align_at_ns'"));
  EXPECT_THAT(refused({{"stream", "fluoroscopy"}, {"geometry", geometry}, {"force", true}}),
              HasSubstr("'force' is nothing"));
}

TEST_F(MatchingApiTest, AnAlignmentIsAskedForInWordsOfTheProgram) {
  serve("echo \"$@\" > " + (folder_ / "asked").string() + "; cat > /dev/null");
  unlock();
  const auto asked = [&](const json& alignment) {
    const Response begun = ask("POST", "comparisons",
                               {{"name", "laid"},
                                {"by_hand", {{"steps", json::array()}}},
                                {"fluoroscopy", nullptr},
                                {"alignment", alignment}});
    EXPECT_EQ(begun.status, 202) << text_of(begun);
    EXPECT_EQ(ended()["state"], "done");
    std::ifstream in(folder_ / "asked");
    return std::string{std::istreambuf_iterator<char>(in), {}};
  };
  EXPECT_THAT(asked(nullptr), Not(HasSubstr("--align")));
  EXPECT_THAT(asked({{"field_deg", 60}}), HasSubstr(" --align auto --field 60\n"));
  EXPECT_THAT(
      asked(
          {{"field_deg", 57.5}, {"view", "head"}, {"from_ns", 1'500'000'000}, {"to_ns", 3'601'500'000'000}}),
      HasSubstr(" --align auto --field 57.5 --view head --from 00:00:01.5 --to 01:00:01.5\n"));

  EXPECT_THAT(asked({{"field_deg", 60}, {"organ", "deformed"}}), HasSubstr(" --field 60 --organ deformed\n"));

  const auto refused = [&](const json& alignment, const json& by_hand = json::object()) {
    const Response answer =
        ask("POST", "comparisons", {{"name", "laid"}, {"by_hand", by_hand}, {"alignment", alignment}});
    EXPECT_EQ(answer.status, 400) << text_of(answer);
    return text_of(answer);
  };
  EXPECT_THAT(refused("auto"), HasSubstr("must be an object"));
  for (const json& field : {json(), json("60"), json(9.9), json(121), json(1e300)})
    EXPECT_THAT(refused({{"field_deg", field}}), HasSubstr("'field_deg'")) << field;
  for (const json& view : {json(), json(7), json("20,10"), json("--force")})
    EXPECT_THAT(refused({{"field_deg", 60}, {"view", view}}), HasSubstr("'view'")) << view;
  for (const json& time : {json("now"), json(-1), json(1.5), json(UINT64_MAX)}) {
    EXPECT_THAT(refused({{"field_deg", 60}, {"from_ns", time}}), HasSubstr("'from_ns'")) << time;
    EXPECT_THAT(refused({{"field_deg", 60}, {"to_ns", time}}), HasSubstr("'to_ns'")) << time;
  }
  EXPECT_THAT(refused({{"field_deg", 60}, {"from_ns", 5}, {"to_ns", 5}}), HasSubstr("after 'from_ns'"));
  EXPECT_THAT(refused({{"field_deg", 60}, {"from_ns", 0}, {"to_ns", kLongestAlignedStretchNs + 1}}),
              HasSubstr("an hour at most"));
  EXPECT_THAT(refused({{"field_deg", 60},
                       {"organ", "deformed"},
                       {"from_ns", 0},
                       {"to_ns", kLongestDeformedStretchNs + 1}}),
              HasSubstr("ten minutes"));
  for (const json& organ : {json(), json(7), json("--force")})
    EXPECT_THAT(refused({{"field_deg", 60}, {"organ", organ}}), HasSubstr("'organ'")) << organ;
  EXPECT_THAT(refused({{"field_deg", 60}, {"force", true}}), HasSubstr("'force' is nothing"));
  EXPECT_THAT(refused({{"field_deg", 60}}, {{"registration", json::object()}}), HasSubstr("leave one of"));
}

}  // namespace
}  // namespace kiroku::viewer
