// Comparisons that `kiroku compare` kept, as `kiroku view` gives them, and attacks on that.
#include <cmath>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "crypto/encoding.h"
#include "crypto/hash.h"
#include "tests/support/cube_plan.h"
#include "tests/support/decoded_video.h"
#include "tests/system/viewer/served_home.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;
using testing::HasSubstr;
using testing::Not;

/// A sealed plan, a case recorded by it, and a comparison of the two that is kept.
class KeptComparisons : public ServedHome {
 protected:
  void SetUp() override {
    ASSERT_NO_FATAL_FAILURE(make_demo_home());
    write_cube_plan(folder());
    ASSERT_EQ(kiroku({"plan", "seal", "plan.json"}).status, 0);
    const fs::path recorded =
        kiroku_json({"record", "--json", "--endoscope", "synthetic:endoscope?size=160x120&speed=max",
                     "--vitals", "synthetic:patient?speed=max", "--duration", "00:00:04", "--plan",
                     "plan.seal.json"})["case"]
            .get<std::string>();
    case_id_ = recorded.filename().string();
    write_text(folder() / "hand.json", R"({"steps": [{"step": 2, "start": "00:00:01", "end": "00:00:03"}]})");
    made_ = keep({});
    ASSERT_NO_FATAL_FAILURE(add_users());
    start();
  }

  /// What `kiroku compare --json` says of a comparison that is kept.
  [[nodiscard]] json keep(const Arguments& more) const {
    Arguments arguments{"compare", case_id_, "plan.seal.json", "--by-hand", "hand.json",
                        "--gpu",   "off",    "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku_json(arguments);
  }
  [[nodiscard]] json list(const std::string& cookie) const {
    const HttpResponse answer = ask("GET", case_path("/comparisons"), cookie);
    EXPECT_EQ(answer.status, 200) << answer.body;
    return json::parse(answer.body);
  }
  [[nodiscard]] std::string unlocked(const std::string& role) const {
    const std::string cookie = sign_in("a-" + role);
    const HttpResponse answer = ask("POST", "/api/session/unlock", cookie,
                                    json{{"identity", read_text(home() / "identity.txt")}}.dump());
    EXPECT_EQ(answer.status, 200) << answer.body;
    return cookie;
  }
  [[nodiscard]] fs::path kept(const std::string& name) const {
    return home() / "comparisons" / case_id_ / name;
  }
  /// What was answered to a check, of those in `judged`.
  static std::string answer_about(const json& judged, const std::string& about) {
    for (const json& check : judged["checks"])
      if (check["about"] == about) return check["answer"];
    return "absent";
  }

  json made_;
};

TEST_F(KeptComparisons, AreShownWithWhatProvesThem) {
  EXPECT_EQ(made_["name"], "plan");
  EXPECT_EQ(made_["pictures"], 21) << "the plan's 2 s in steps of 0.1 s";
  const std::string cookie = unlocked("surgeon");
  const json answer = list(cookie);
  ASSERT_EQ(answer["comparisons"].size(), 1U) << answer;
  EXPECT_EQ(answer["unreadable"].size(), 0U);
  const json& row = answer["comparisons"][0];
  EXPECT_EQ(row["name"], "plan");
  EXPECT_EQ(row["plan"], "cube");
  EXPECT_EQ(row["replay"], true);
  EXPECT_EQ(row["made_by"], row["entered_by"]);
  EXPECT_EQ(row["whole"]["verdict"], "holds") << row;
  EXPECT_EQ(row["sealed_before"]["verdict"], "holds") << row;
  for (const char* about : {"document", "time", "case", "replay"})
    EXPECT_EQ(answer_about(row["whole"], about), "holds") << about;
  for (const char* about : {"named", "order", "time"})
    EXPECT_EQ(answer_about(row["sealed_before"], about), "holds") << about;
  EXPECT_THAT(accesses().back(), HasSubstr(case_id_ + " read comparisons a-surgeon (kiroku view"));

  const HttpResponse document = ask("GET", case_path("/comparisons/plan"), cookie);
  EXPECT_EQ(document.status, 200);
  EXPECT_EQ(crypto::to_hex(crypto::sha256(bytes_of(document.body))), made_["sha256"]) << "byte for byte";
  EXPECT_EQ(json::parse(document.body)["time_map"]["pieces"][0]["knots"],
            json::parse("[[0,1000000000],[1,3000000000]]"));
  EXPECT_THAT(accesses().back(), HasSubstr("read comparison plan"));

  const HttpResponse film = ask("GET", case_path("/comparisons/plan/replay.mp4"), cookie);
  EXPECT_EQ(film.status, 200);
  EXPECT_EQ(film.headers.at("content-type"), "video/mp4");
  EXPECT_EQ(film.headers.at("cache-control"), "no-store");
  EXPECT_EQ(film.body.substr(4, 4), "ftyp");
  EXPECT_EQ(crypto::to_hex(crypto::sha256(bytes_of(film.body))),
            json::parse(document.body)["outputs"][0]["sha256"]);
  const DecodedVideo plan = decode_video(bytes_of(film.body));
  ASSERT_EQ(plan.frames.size(), 21U);
  EXPECT_TRUE(plan.frames[5].key) << "one can go anywhere within half a second of it";
  // Tissue is lifted in the first second and held in the second.
  const double lifted = std::abs(plan.frames[10].brightness - plan.frames[0].brightness);
  EXPECT_GT(lifted, 0.2);
  EXPECT_LT(std::abs(plan.frames[20].brightness - plan.frames[10].brightness), lifted / 4);
  EXPECT_GT(std::abs(plan.frames[5].brightness - plan.frames[0].brightness), lifted / 8) << "and not at once";
  EXPECT_GT(std::abs(plan.frames[10].brightness - plan.frames[5].brightness), lifted / 8);
  const HttpResponse part =
      ask("GET", case_path("/comparisons/plan/replay.mp4"), cookie, "", {{"Range", "bytes=4-7"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, "ftyp");
  EXPECT_THAT(accesses().back(), HasSubstr("watched the plan of comparison plan"));
}

TEST_F(KeptComparisons, LeaveTheCaseAloneAndLieSealed) {
  EXPECT_EQ(kiroku_json({"verify", case_id_, "--json"})["verdict"], "intact");
  std::vector<std::string> files;
  for (const auto& entry : fs::directory_iterator(home() / "comparisons" / case_id_)) {
    files.push_back(entry.path().filename().string());
    if (entry.path().extension() == ".age") {
      EXPECT_TRUE(read_text(entry.path()).starts_with("age-encryption.org/v1\n")) << entry.path();
      EXPECT_EQ(entry.status().permissions() & fs::perms::others_all, fs::perms::none) << entry.path();
    }
  }
  EXPECT_THAT(files, testing::UnorderedElementsAre("plan.comparison.json.age", "plan.replay.mp4.age",
                                                   "plan.comparison.embedded.tsr", "plan.seal.embedded.tsr"));
  EXPECT_REFUSED(kiroku({"compare", case_id_, "plan.seal.json", "--by-hand", "hand.json"}),
                 "has a comparison 'plan' already");
  EXPECT_REFUSED(kiroku({"compare", case_id_, "plan.seal.json", "--name", "../x"}), "cannot be called");
  EXPECT_EQ(keep({"--name", "second", "--made-by", "Dr. Sato"})["name"], "second");
  EXPECT_EQ(keep({"--force"})["name"], "plan");
  const json rows = list(unlocked("surgeon"))["comparisons"];
  ASSERT_EQ(rows.size(), 2U);
  EXPECT_EQ(rows[0]["whole"]["verdict"], "holds") << "tokens of the replaced one are gone";
  EXPECT_EQ(rows[1]["made_by"], "Dr. Sato");
  EXPECT_NE(rows[1]["entered_by"], "Dr. Sato") << "the log says who it was on this machine";
}

TEST_F(KeptComparisons, HoldThePlansRadiographsWhereTheCaseHasFluoroscopy) {
  // A film of the plan's radiographs, of a patient who lay 2 mm to the left and 1.5 mm to the feet, recorded
  // as if it were the fluoroscope's.
  const auto geometry = [&](const char* name, double x_mm, double z_mm) {
    write_text(folder() / name, json{{"sad_mm", 1000},
                                     {"sid_mm", 1500},
                                     {"isocenter_mm", {x_mm, 5, z_mm}},
                                     {"detector_px", {128, 128}},
                                     {"detector_mm", {48, 48}}}
                                    .dump());
  };
  geometry("planned.json", 5, 5);
  geometry("lain.json", 3, 6.5);
  ASSERT_EQ(kiroku({"plan", "run", "plan.json", "-o", "run"}).status, 0);
  const ProcessResult film =
      kiroku({"sim", "drr-film", "ct.nrrd", "-g", "lain.json", "--mesh", "cube.msh", "--frames", "run",
              "--polarity", "bone-black", "--rate", "10", "-o", "xray.mkv"});
  ASSERT_EQ(film.status, 0) << film.err;
  case_id_ = fs::path(kiroku_json({"record", "--json", "--fluoroscopy", "xray.mkv?speed=max", "--profile",
                                   "lossless", "--duration", "00:00:02", "--plan", "plan.seal.json"})["case"]
                          .get<std::string>())
                 .filename()
                 .string();
  write_text(folder() / "hand.json", R"({"steps": [{"step": 2, "start": "00:00:00", "end": "00:00:01"},
                                                    {"step": 3, "start": "00:00:01"}]})");
  const json made = keep({"--geometry", "planned.json", "--align-at", "00:00:00.5"});
  // A run has two frames of its beginning, so that its film is a tenth of a second late: not wholly alike.
  EXPECT_GT(made["similarity"]["after"].get<double>(), 0.8) << made;
  EXPECT_LT(made["similarity"]["before"].get<double>(), 0.2) << made;

  const std::string cookie = unlocked("surgeon");
  const json row = list(cookie)["comparisons"][0];
  EXPECT_EQ(row["radiographs"], true);
  EXPECT_EQ(answer_about(row["whole"], "radiographs"), "holds") << row;
  const json document = json::parse(ask("GET", case_path("/comparisons/plan"), cookie).body);
  const json& found = document["fluoroscopy"];
  EXPECT_EQ(found["stream"], "fluoroscopy");
  EXPECT_NEAR(found["alignment"]["translation_mm"][0].get<double>(), 2, 0.3) << found;
  EXPECT_NEAR(found["alignment"]["translation_mm"][2].get<double>(), -1.5, 0.3) << found;
  const HttpResponse radiographs = ask("GET", case_path("/comparisons/plan/radiographs.mp4"), cookie);
  ASSERT_EQ(radiographs.status, 200);
  EXPECT_EQ(crypto::to_hex(crypto::sha256(bytes_of(radiographs.body))), document["outputs"][1]["sha256"]);
  EXPECT_EQ(decode_video(bytes_of(radiographs.body)).frames.size(), 21U);
  const HttpResponse part =
      ask("GET", case_path("/comparisons/plan/radiographs.mp4"), cookie, "", {{"Range", "bytes=-100"}});
  EXPECT_EQ(part.status, 206);
  EXPECT_EQ(part.body, radiographs.body.substr(radiographs.body.size() - 100));

  for (const char* form : {"beside", "overlay", "wipe", "difference", "checkerboard", "contour"}) {
    const ProcessResult shown =
        kiroku({"compare", case_id_, "plan.seal.json", "--by-hand", "hand.json", "--geometry", "planned.json",
                "--show", form, "-o", std::string(form) + ".mp4"});
    EXPECT_EQ(shown.status, 0) << form << ": " << shown.err;
    EXPECT_THAT(shown.out, HasSubstr("fluoroscopy: gradient correlation")) << form;
  }
  EXPECT_REFUSED(kiroku({"compare", case_id_, "plan.seal.json", "--by-hand", "hand.json", "--show", "contour",
                         "-o", "out.mp4"}),
                 "say with --geometry");
}

TEST_F(KeptComparisons, AreGivenToNobodyElse) {
  for (const std::string rest : {"/comparisons", "/comparisons/plan", "/comparisons/plan/replay.mp4",
                                 "/comparisons/plan/radiographs.mp4"}) {
    EXPECT_EQ(ask("GET", case_path(rest)).status, 401) << rest;
    EXPECT_EQ(ask("GET", case_path(rest), sign_in("a-operator")).status, 403) << rest;
    EXPECT_EQ(ask("GET", case_path(rest), sign_in("a-auditor")).status, 403) << rest;
  }
  ASSERT_EQ(ask("DELETE", "/api/session/unlock", sign_in("a-surgeon"), "{}").status, 204);
  const std::string locked = sign_in("a-surgeon");
  ASSERT_EQ(ask("DELETE", "/api/session/unlock", locked, "{}").status, 204);
  for (const std::string rest : {"/comparisons", "/comparisons/plan", "/comparisons/plan/replay.mp4"})
    EXPECT_EQ(ask("GET", case_path(rest), locked).status, 423) << rest;

  // An identity that opens nothing here.
  const std::string stranger = sign_in("a-surgeon");
  const std::string key = "AGE-SECRET-KEY-184JMZMVQH3E6U0PSL869004Y3U2NYV7R30EU99CSEDNPH02YUVFSZW44VU";
  ASSERT_EQ(ask("POST", "/api/session/unlock", stranger, json{{"identity", key}}.dump()).status, 200);
  EXPECT_EQ(ask("GET", case_path("/comparisons/plan"), stranger).status, 403);
  const json nothing = list(stranger);
  EXPECT_EQ(nothing["comparisons"].size(), 0U);
  EXPECT_EQ(nothing["unreadable"].size(), 1U);

  const std::string cookie = unlocked("administrator");
  fs::create_directory_symlink(home(), home() / "comparisons" / "20200101T000000Z-00000000");
  fs::create_symlink(home() / "identity.txt", kept("link.comparison.json.age"));
  for (const std::string& target :
       {case_path("/comparisons/none"), case_path("/comparisons/none/replay.mp4"),
        case_path("/comparisons/.."), case_path("/comparisons/%2e%2e%2fplan"), case_path("/comparisons/Plan"),
        case_path("/comparisons/link"), std::string("/api/cases/20200101T000000Z-00000000/comparisons"),
        std::string("/api/cases/20200101T000000Z-00000000/comparisons/plan")}) {
    const HttpResponse answer = ask("GET", target, cookie);
    EXPECT_THAT(answer.status, testing::AnyOf(400, 404)) << target << " " << answer.body;
    EXPECT_THAT(answer.body, Not(HasSubstr("SECRET"))) << target;
  }
}

TEST_F(KeptComparisons, ThatWereChangedAreFoundOut) {
  const std::string cookie = unlocked("surgeon");
  // Another film, sealed for the same reader.
  write_text(folder() / "other.mp4", "not the film that was made");
  const std::string recipient = read_text(home() / "recipients.txt");
  write_text(folder() / "recipients.txt", recipient);
  fs::remove(kept("plan.replay.mp4.age"));
  ASSERT_EQ(kiroku({"seal", "-R", "recipients.txt", "-o", kept("plan.replay.mp4.age").string(), "other.mp4"})
                .status,
            0);
  json row = list(cookie)["comparisons"][0];
  EXPECT_EQ(row["whole"]["verdict"], "differs");
  EXPECT_EQ(answer_about(row["whole"], "replay"), "differs");
  EXPECT_EQ(answer_about(row["whole"], "document"), "holds");

  // A document that says something else.
  std::string text = ask("GET", case_path("/comparisons/plan"), cookie).body;
  text.replace(text.find("\"cube\""), 6, "\"cubE\"");
  write_text(folder() / "forged.json", text);
  fs::remove(kept("plan.comparison.json.age"));
  ASSERT_EQ(
      kiroku({"seal", "-R", "recipients.txt", "-o", kept("plan.comparison.json.age").string(), "forged.json"})
          .status,
      0);
  row = list(cookie)["comparisons"][0];
  EXPECT_EQ(row["entered_by"], nullptr);
  EXPECT_EQ(answer_about(row["whole"], "document"), "could-not-check") << "the log does not know it";
  EXPECT_EQ(answer_about(row["whole"], "time"), "differs") << "the token is about another";
  EXPECT_EQ(row["whole"]["verdict"], "differs");

  // Bytes that are no sealed file hide none of the others.
  EXPECT_EQ(keep({"--name", "other"})["name"], "other");
  write_text(kept("plan.comparison.json.age"), "age-encryption.org/v1\nnothing");
  const json answer = list(cookie);
  EXPECT_EQ(answer["comparisons"].size(), 1U);
  EXPECT_EQ(answer["unreadable"][0]["name"], "plan");
  EXPECT_EQ(ask("GET", case_path("/comparisons/plan"), cookie).status, 422);
}

TEST_F(KeptComparisons, SayWhereAPlanWasSealedTooLateOrNotAtAll) {
  const std::string plan = read_text(folder() / "plan.json");
  write_text(folder() / "late.json", plan);
  ASSERT_EQ(kiroku({"plan", "seal", "late.json"}).status, 0);
  EXPECT_EQ(kiroku_json({"compare", case_id_, "late.seal.json", "--by-hand", "hand.json", "--gpu", "off",
                         "--json"})["name"],
            "late");
  write_text(folder() / "Never sealed.json", plan);
  EXPECT_EQ(kiroku_json({"compare", case_id_, "Never sealed.json", "--by-hand", "hand.json", "--gpu", "off",
                         "--json"})["name"],
            "never-sealed");
  const json rows = list(unlocked("surgeon"))["comparisons"];
  ASSERT_EQ(rows.size(), 3U);
  EXPECT_EQ(rows[0]["name"], "late");
  EXPECT_EQ(rows[0]["sealed_before"]["verdict"], "differs");
  EXPECT_EQ(answer_about(rows[0]["sealed_before"], "order"), "differs") << rows[0];
  EXPECT_EQ(rows[1]["name"], "never-sealed");
  EXPECT_EQ(answer_about(rows[1]["sealed_before"], "order"), "could-not-check") << rows[1];
  EXPECT_EQ(answer_about(rows[1]["sealed_before"], "time"), "could-not-check");
  EXPECT_EQ(rows[2]["sealed_before"]["verdict"], "holds");
}

}  // namespace
}  // namespace kiroku::test
