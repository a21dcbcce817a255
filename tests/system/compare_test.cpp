// 'kiroku compare' as a person calls it.
#include "tests/support/cube_plan.h"
#include "tests/support/decoded_video.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// A plan of three steps for a cube of tissue, and a case: the plan's own replay, recorded as if it were the
/// endoscope's.
class CompareProgram : public ProgramTest {
 protected:
  void SetUp() override {
    write_cube_plan(folder());
    make_demo_home();
    sealed_ = kiroku_json({"plan", "seal", "plan.json", "--json"})["sha256"];
    const nlohmann::json film = kiroku_json({"plan", "replay", "plan.json", "-o", "replay.mkv", "--gpu",
                                             "off", "--size", "160x120", "--no-caption", "--json"});
    EXPECT_EQ(film["film"], "replay.mkv");
    case_ = kiroku_json({"record", "--json", "--endoscope", "replay.mkv?speed=max", "--profile", "lossless",
                         "--vitals", "synthetic:patient?speed=max", "--duration", "00:00:02", "--plan",
                         "plan.seal.json"})["case"]
                .get<std::string>();
    write_text(folder() / "hand.json",
               R"({"steps": [{"step": 3, "start": "00:00:00.1", "end": "00:00:00.6"},
                             {"step": 2, "start": "00:00:01", "end": "00:00:02"}]})");
  }
  [[nodiscard]] nlohmann::json compare(const std::string& output, Arguments more = {}) const {
    Arguments arguments{"compare",   case_.string(), "plan.seal.json", "-o",  output,
                        "--by-hand", "hand.json",    "--gpu",          "off", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku_json(arguments);
  }
  [[nodiscard]] int height_of_film(const std::string& file) const {
    const std::string film = read_text(folder() / file);
    const DecodedVideo decoded = decode_video(bytes_of(film), 1);
    return decoded.frames.empty() ? 0 : decoded.frames.front().height;
  }
  /// Everything in the case, byte for byte.
  [[nodiscard]] std::string whole_case() const {
    std::string all;
    for (const std::string& file : files_below(case_)) {
      if (fs::is_regular_file(case_ / file)) all += file + "\n" + read_text(case_ / file);
    }
    return all;
  }

  fs::path case_;
  std::string sealed_;
};

TEST_F(CompareProgram, MakesADocumentThatSaysWhatItStandsOn) {
  const std::string before = whole_case();
  const nlohmann::json made = compare("out.json", {"--made-by", "Dr. Sato"});
  EXPECT_EQ(made["steps_found"], 2);
  EXPECT_EQ(made["in_planned_order"], false);
  EXPECT_TRUE(made["time_stamps"][0].contains("gen_time")) << made.dump();
  EXPECT_EQ(made["time_stamps"][0]["kind"], "self-issued");
  EXPECT_EQ(made["time"], "self-issued");
  const nlohmann::json document = nlohmann::json::parse(read_text(folder() / "out.json"));
  EXPECT_EQ(document["format"], "kiroku-comparison/1");
  EXPECT_EQ(document["made_by"], "Dr. Sato");
  EXPECT_EQ(document["case"]["id"], case_.filename().string());
  EXPECT_EQ(document["case"]["names_plan"], true);
  EXPECT_EQ(document["plan"]["seal"], sealed_);
  EXPECT_EQ(document["plan"]["sealed"], true);
  EXPECT_EQ(document["plan"]["files"].size(), 3U);
  EXPECT_EQ(document["steps"][0]["done"], nullptr);
  EXPECT_EQ(document["steps"][1]["name"], "Lift");
  EXPECT_EQ(document["steps"][1]["done"]["order"], 2);
  EXPECT_EQ(document["steps"][1]["done"]["pause_before_ns"], 400'000'000);
  EXPECT_EQ(document["steps"][1]["done"]["start_from"], "hand");
  EXPECT_FALSE(document["steps"][1]["vitals"].empty());
  EXPECT_EQ(document["time_map"]["monotone"], false);
  EXPECT_EQ(document["time_map"]["pieces"][1]["knots"],
            nlohmann::json::parse("[[0,1000000000],[1,2000000000]]"));
  const nlohmann::json log = kiroku_json({"log", "--json"});
  EXPECT_THAT(log.dump(), HasSubstr("document sha256 " + made["sha256"].get<std::string>()));
  EXPECT_EQ(whole_case(), before);
  EXPECT_EQ(kiroku_json({"verify", case_.string(), "--json"})["verdict"], "intact");
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "out.json", "--by-hand", "hand.json"}),
                 "is already there");
}

TEST_F(CompareProgram, MakesAPageWithoutAnythingFromElsewhere) {
  EXPECT_EQ(compare("out.html")["pictures"], 2);
  const std::string page = read_text(folder() / "out.html");
  EXPECT_THAT(page, HasSubstr("2 of 3 planned steps were found"));
  EXPECT_THAT(page, HasSubstr("in another order than planned"));
  EXPECT_THAT(page, HasSubstr("data:image/png;base64,"));
  EXPECT_THAT(page, Not(HasSubstr("://")));
  EXPECT_THAT(page, Not(HasSubstr("<script")));
  // The document beside it names it.
  const auto outputs = nlohmann::json::parse(read_text(folder() / "out.comparison.json"))["outputs"];
  EXPECT_EQ(outputs[0]["name"], "out.html");
}

TEST_F(CompareProgram, HandsNoPicturesOutWithoutTheConsentThatTheSiteDemands) {
  write_text(home() / "kiroku.toml",
             read_text(home() / "kiroku.toml") + "\n[consent]\ndemand_purpose = true\n");
  const auto made = [&](const std::string& output, const Arguments& more) {
    Arguments arguments{"compare",   case_.string(), "plan.seal.json", "-o", output,
                        "--by-hand", "hand.json",    "--gpu",          "off"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  const Arguments purpose{"--purpose", "teaching"};
  for (const char* output : {"out.html", "out.mp4", "out.json"}) {
    EXPECT_REFUSED(made(output, {}), "this site demands a purpose");
    EXPECT_REFUSED(made(output, purpose), "no consent to the purpose teaching was given");
    EXPECT_FALSE(fs::exists(folder() / output));
  }
  const auto by_hand = [&](const Arguments& more) {
    Arguments arguments{"compare",   case_.string(),    "plan.seal.json", "--by-hand",
                        "hand.json", "--write-by-hand", "again.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  EXPECT_REFUSED(by_hand({}), "this site demands a purpose");
  EXPECT_REFUSED(by_hand(purpose), "no consent to the purpose teaching was given");
  EXPECT_FALSE(fs::exists(folder() / "again.json"));
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.seal.json", "--by-hand", "hand.json", "--purpose",
                         "teaching"}),
                 "--purpose is for what is written in the clear");
  write_text(folder() / "who.txt", "Hana Mori, patient\n");
  const nlohmann::json given = kiroku_json(
      {"consent", "give", case_.string(), "--purpose", "teaching", "--person", "who.txt", "--json"});
  EXPECT_EQ(given["given"][0], "teaching");
  const ProcessResult page = made("out.html", purpose);
  EXPECT_EQ(page.status, 0) << page.err;
  EXPECT_EQ(made("figures.json", purpose).status, 0) << "it holds marks and vital signs";
  EXPECT_EQ(by_hand(purpose).status, 0);
  EXPECT_THAT(read_text(home() / "archive/log/ledger.jsonl"), HasSubstr("wrote the steps that were found"));
  const std::string log = read_text(home() / "archive/log/ledger.jsonl");
  EXPECT_THAT(log, HasSubstr("wrote a comparison with a plan"));
  EXPECT_THAT(log, HasSubstr("\"purpose\":\"teaching\""));
}

TEST_F(CompareProgram, MakesTheSameFilmEachTime) {
  const nlohmann::json made = compare("one.mp4", {"--speed", "2"});
  EXPECT_NEAR(made["pictures"].get<double>(), 25, 3);
  EXPECT_EQ(compare("two.mp4", {"--speed", "2"})["steps_found"], 2);
  EXPECT_EQ(read_text(folder() / "one.mp4"), read_text(folder() / "two.mp4"));
  for (const char* form : {"overlay", "wipe"}) {
    const nlohmann::json other =
        compare(std::string(form) + ".mp4", {"--speed", "4", "--show", form, "--share", "0.3"});
    EXPECT_GT(other["pictures"], 10);
  }
  EXPECT_GT(fs::file_size(folder() / "wipe.mp4"), 1000U);
}

TEST_F(CompareProgram, TellsWhetherAComparisonStillFits) {
  EXPECT_EQ(compare("out.html")["in_log"], true);
  const auto verify = [&](const Arguments& more) {
    Arguments arguments{"compare", "--verify", "out.comparison.json"};
    arguments.insert(arguments.begin() + 1, more.begin(), more.end());
    return kiroku(arguments);
  };
  const Arguments both{case_.string(), "plan.json"};
  const ProcessResult whole = verify(both);
  EXPECT_EQ(whole.status, 0) << whole.out << whole.err;
  EXPECT_THAT(whole.out, HasSubstr("out.comparison.json: HOLDS"));
  // Without the plan that part is not known; the case is found by its identifier.
  const ProcessResult alone = verify({});
  EXPECT_EQ(alone.status, 3);
  EXPECT_THAT(alone.out, HasSubstr("not known: name the plan"));
  EXPECT_THAT(alone.out, HasSubstr("are as they were compared"));
  // Another appliance knows neither the log nor the authority.
  ASSERT_EQ(kiroku({"init", "--demo", "--home", path("other")}).status, 0);
  const ProcessResult elsewhere = kiroku(
      {"compare", case_.string(), "plan.json", "--verify", "out.comparison.json", "--home", path("other")});
  EXPECT_EQ(elsewhere.status, 3) << elsewhere.out;
  EXPECT_THAT(elsewhere.out, HasSubstr("does not know this comparison"));

  const std::string page = read_text(folder() / "out.html");
  write_text(folder() / "out.html", page + " ");
  EXPECT_THAT(verify(both).out, HasSubstr("NO: out.html was changed since"));
  EXPECT_EQ(verify(both).status, 1);
  write_text(folder() / "out.html", page);
  const std::string mesh = read_text(folder() / "cube.msh");
  write_text(folder() / "cube.msh", mesh + "\n");
  EXPECT_THAT(verify(both).out, HasSubstr("NO: cube.msh is not what was sealed"));
  EXPECT_THAT(kiroku({"compare", case_.string(), "plan.seal.json", "-o", "more.json"}).err,
              HasSubstr("the plan is not the one that was sealed"));
  write_text(folder() / "cube.msh", mesh);
  flip_byte(case_ / "ledger.jsonl", 40);
  const ProcessResult tampered = verify(both);
  EXPECT_NE(tampered.status, 0);
  EXPECT_THAT(tampered.out, Not(HasSubstr("are as they were compared")));
  flip_byte(case_ / "ledger.jsonl", 40);
  std::string text = read_text(folder() / "out.comparison.json");
  text.replace(text.find("Lift"), 4, "Left");
  write_text(folder() / "out.comparison.json", text);
  const ProcessResult forged = verify(both);
  EXPECT_EQ(forged.status, 1);
  EXPECT_THAT(forged.out, HasSubstr("does not know this comparison"));
}

// A plan of another patient, compared with the case and sealed to it, is as it was made.
TEST_F(CompareProgram, AComparisonWithAnotherPlanThanTheCasesIsToldWhereItIsChecked) {
  std::string another = read_text(folder() / "plan.json");
  another.replace(another.find("Lift"), 4, "Push");
  write_text(folder() / "another.json", another);
  ASSERT_EQ(kiroku({"compare", case_.string(), "another.json", "-o", "other.json", "--by-hand", "hand.json",
                    "--gpu", "off"})
                .status,
            0);
  const Arguments verify{"compare", case_.string(), "another.json", "--verify", "other.json"};
  const ProcessResult told = kiroku(verify);
  EXPECT_EQ(told.status, 1) << told.out;
  EXPECT_THAT(told.out, HasSubstr("other.json: DIFFERS"));
  EXPECT_THAT(told.out, HasSubstr("was recorded by another plan"));
  // Nobody sealed it.
  EXPECT_THAT(told.out, HasSubstr("are as they were compared"));
  EXPECT_THAT(told.out, Not(HasSubstr("as they were sealed")));
  Arguments as_json = verify;
  as_json.emplace_back("--json");
  EXPECT_EQ(nlohmann::json::parse(kiroku(as_json).out)["case_names_plan"], false);
  // Of the case's own plan the same command says so.
  ASSERT_FALSE(compare("out.json").empty());
  const ProcessResult own = kiroku({"compare", case_.string(), "plan.json", "--verify", "out.json"});
  EXPECT_EQ(own.status, 0) << own.out;
  EXPECT_THAT(own.out, HasSubstr("was recorded by this plan"));
  EXPECT_THAT(own.out, HasSubstr("are as they were sealed"));
}

// It is told where it is made, too: whoever is handed the film never checks the document.
TEST_F(CompareProgram, AComparisonWithAnotherPlanThanTheCasesIsToldWhereItIsMade) {
  std::string another = read_text(folder() / "plan.json");
  another.replace(another.find("Lift"), 4, "Push");
  write_text(folder() / "another.json", another);
  const auto made = [&](const std::string& plan, Arguments more) {
    Arguments arguments{"compare", case_.string(), plan, "--by-hand", "hand.json", "--gpu", "off"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  const char* const said = "The case was recorded by another plan than the one shown";
  EXPECT_THAT(made("another.json", {"-o", "a.json"}).out, HasSubstr(said));
  EXPECT_THAT(made("another.json", {"--steps"}).out, HasSubstr(said));
  const nlohmann::json told = nlohmann::json::parse(made("another.json", {"-o", "b.json", "--json"}).out);
  EXPECT_EQ(told["case_names_plan"], false);
  EXPECT_EQ(told["cautions"][0], said);
  EXPECT_EQ(nlohmann::json::parse(made("another.json", {"--steps", "--json"}).out)["case_names_plan"], false);
  EXPECT_THAT(made("another.json", {"-o", "a.html"}).out, HasSubstr("CAUTION"));
  EXPECT_THAT(read_text(folder() / "a.html"), HasSubstr(said));
  // The film has a line more above its pictures.
  EXPECT_EQ(made("another.json", {"-o", "film.mp4", "--speed", "8"}).status, 0);
  const ProcessResult own = made("plan.seal.json", {"-o", "own.mp4", "--speed", "8"});
  EXPECT_THAT(own.out, Not(HasSubstr("CAUTION")));
  EXPECT_GT(height_of_film("film.mp4"), height_of_film("own.mp4"));
}

TEST_F(CompareProgram, AnotherCtThanThePlansIsRefusedAndOneOfNoPlanIsTold) {
  fs::create_directory(folder() / "other");
  std::string ct = read_text(folder() / "ct.nrrd");
  write_text(folder() / "other/same.nrrd", ct);
  ct.back() = static_cast<char>(ct.back() ^ 1);
  write_text(folder() / "other/patient-b.nrrd", ct);
  const auto made = [&](const std::string& plan, Arguments more) {
    Arguments arguments{"compare", case_.string(), plan, "--by-hand", "hand.json", "--gpu", "off"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  for (const char* output : {"a.html", "a.mp4", "a.json"}) {
    EXPECT_REFUSED(made("plan.seal.json", {"-o", output, "--volume", "other/patient-b.nrrd"}),
                   "is another CT than the plan's");
    EXPECT_FALSE(fs::exists(folder() / output));
  }
  const ProcessResult same = made("plan.seal.json", {"-o", "same.html", "--volume", "other/same.nrrd"});
  EXPECT_EQ(same.status, 0) << same.err;
  EXPECT_THAT(same.out, Not(HasSubstr("CAUTION")));
  std::string without = read_text(folder() / "plan.json");
  const std::string named = "\"volume\": \"ct.nrrd\", ";
  without.erase(without.find(named), named.size());
  write_text(folder() / "without.json", without);
  const ProcessResult other = made("without.json", {"-o", "b.html", "--volume", "other/patient-b.nrrd"});
  EXPECT_EQ(other.status, 0) << other.err;
  const char* const said = "The CT shown is not part of the plan: patient-b.nrrd";
  EXPECT_THAT(other.out, HasSubstr(said));
  EXPECT_THAT(read_text(folder() / "b.html"), HasSubstr(said));
  const auto document = nlohmann::json::parse(read_text(folder() / "b.comparison.json"));
  EXPECT_EQ(document["ct"]["of_plan"], false);
  EXPECT_EQ(document["ct"]["files"][0]["name"], "patient-b.nrrd");
  EXPECT_THAT(kiroku({"compare", case_.string(), "without.json", "--verify", "b.comparison.json"}).out,
              HasSubstr("is not part of the plan"));
}

/// The cube's CT as a folder of DICOM files of this patient, in explicit little endian (PS3.5, 7.1.2).
void write_dicom_ct(const fs::path& folder, const std::string& patient) {
  fs::create_directory(folder);
  const auto number = [](std::uint32_t value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i) text += static_cast<char>(value >> (8 * i) & 0xffU);
    return text;
  };
  const auto element = [&](std::uint16_t group, std::uint16_t tag, const std::string& kind,
                           std::string value) {
    if (value.size() % 2 != 0) value += kind == "UI" || kind == "OB" ? '\0' : ' ';
    const bool is_long = kind == "OB" || kind == "OW";
    return number(group, 2) + number(tag, 2) + kind +
           (is_long ? number(0, 2) + number(static_cast<std::uint32_t>(value.size()), 4)
                    : number(static_cast<std::uint32_t>(value.size()), 2)) +
           value;
  };
  for (int slice = 0; slice < 20; ++slice) {
    const std::string uid = "1.2.3.5." + std::to_string(slice + 1);
    std::string pixels;
    for (int at = 0; at < 20 * 20; ++at) pixels += number(static_cast<std::uint32_t>(1024 + at % 90), 2);
    const std::string meta = element(2, 1, "OB", std::string("\0\1", 2)) +
                             element(2, 2, "UI", "1.2.840.10008.5.1.4.1.1.2") + element(2, 3, "UI", uid) +
                             element(2, 0x10, "UI", "1.2.840.10008.1.2.1") +
                             element(2, 0x12, "UI", "1.2.3.99");
    std::string file = std::string(128, '\0') + "DICM" +
                       element(2, 0, "UL", number(static_cast<std::uint32_t>(meta.size()), 4)) + meta;
    file += element(8, 0x16, "UI", "1.2.840.10008.5.1.4.1.1.2") + element(8, 0x18, "UI", uid) +
            element(8, 0x60, "CS", "CT") + element(0x10, 0x20, "LO", patient) +
            element(0x20, 0xd, "UI", "1.2.3") + element(0x20, 0xe, "UI", "1.2.3.4") +
            element(0x20, 0x32, "DS", "-5\\-5\\" + std::to_string(slice - 5)) +
            element(0x20, 0x37, "DS", "1\\0\\0\\0\\1\\0") + element(0x28, 2, "US", number(1, 2)) +
            element(0x28, 4, "CS", "MONOCHROME2") + element(0x28, 0x10, "US", number(20, 2)) +
            element(0x28, 0x11, "US", number(20, 2)) + element(0x28, 0x30, "DS", "1\\1") +
            element(0x28, 0x100, "US", number(16, 2)) + element(0x28, 0x101, "US", number(16, 2)) +
            element(0x28, 0x102, "US", number(15, 2)) + element(0x28, 0x103, "US", number(0, 2)) +
            element(0x28, 0x1052, "DS", "-1024") + element(0x28, 0x1053, "DS", "1") +
            element(0x7fe0, 0x10, "OW", pixels);
    write_text(folder / (std::to_string(100 + slice) + ".dcm"), file);
  }
}

// Before the first picture, and not only when plan and recording are compared.
TEST_F(CompareProgram, ACaseThatBeginsByAnotherPatientsPlanIsTold) {
  write_dicom_ct(folder() / "ct", "ALPHA-1");
  std::string plan = read_text(folder() / "plan.json");
  plan.replace(plan.find("ct.nrrd"), 7, "ct");
  write_text(folder() / "dicom.json", plan);
  ASSERT_EQ(kiroku({"plan", "seal", "dicom.json"}).status, 0);
  const auto recorded = [&](const std::string& id) {
    write_text(folder() / "subject.json", R"({"patient": {"id": ")" + id + R"("}})");
    const ProcessResult result =
        kiroku({"record", "--json", "--vitals", "synthetic:patient?speed=max", "--duration", "00:00:02",
                "--subject", "subject.json", "--plan", "dicom.seal.json"});
    EXPECT_EQ(result.status, 0) << result.err;
    const std::string marks =
        read_text(fs::path(nlohmann::json::parse(result.out)["case"].get<std::string>()) / "ledger.jsonl");
    EXPECT_EQ(marks.find("\"type\":\"mark\"") != std::string::npos, !result.err.empty())
        << "it is committed to";
    return result.err;
  };
  EXPECT_THAT(recorded("BRAVO-2"), HasSubstr("the CT of the sealed plan states another patient's number"));
  EXPECT_THAT(recorded("BRAVO-2"), Not(HasSubstr("ALPHA-1")));
  EXPECT_EQ(recorded("ALPHA-1"), "");
}

// The numbers stand where whoever compares reads them, and nowhere that is handed on.
TEST_F(CompareProgram, ACtOfAnotherPatientThanTheCasesIsTold) {
  write_dicom_ct(folder() / "ct", "ALPHA-1");
  std::string plan = read_text(folder() / "plan.json");
  plan.replace(plan.find("ct.nrrd"), 7, "ct");
  write_text(folder() / "dicom.json", plan);
  const auto recorded = [&](const std::string& id) {
    write_text(folder() / "subject.json", R"({"patient": {"id": ")" + id + R"("}})");
    return kiroku_json({"record", "--json", "--endoscope", "replay.mkv?speed=max", "--duration", "00:00:02",
                        "--subject", "subject.json"})["case"]
        .get<std::string>();
  };
  const auto made = [&](const std::string& recording, const std::string& output, Arguments more = {}) {
    Arguments arguments{"compare",   recording,   "dicom.json", "-o",  output,
                        "--by-hand", "hand.json", "--gpu",      "off", "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const ProcessResult result = kiroku(arguments);
    EXPECT_EQ(result.status, 0) << result.err;
    return result.out;
  };
  const std::string other = recorded("BRAVO-2");
  const char* const said = "The CT states another patient's number than the case";
  const std::string told = made(other, "a.html");
  EXPECT_THAT(told, HasSubstr(said));
  EXPECT_THAT(told, HasSubstr("the CT states ALPHA-1, the case BRAVO-2"));
  EXPECT_THAT(read_text(folder() / "a.html"), HasSubstr(said));
  const nlohmann::json json = nlohmann::json::parse(made(other, "b.json", {"--json"}));
  EXPECT_EQ(json["one_patient"], false);
  EXPECT_EQ(json["patient_numbers"]["case"], "BRAVO-2");
  for (const char* file : {"a.html", "a.comparison.json", "b.json"}) {
    EXPECT_THAT(read_text(folder() / file), Not(HasSubstr("BRAVO-2")));
    EXPECT_THAT(read_text(folder() / file), Not(HasSubstr("ALPHA-1")));
  }
  EXPECT_EQ(nlohmann::json::parse(read_text(folder() / "b.json"))["one_patient"], false);
  EXPECT_THAT(made(other, "c.json", {"--asked-by", "somebody"}), Not(HasSubstr("BRAVO-2")));
  EXPECT_THAT(kiroku({"compare", other, "dicom.json", "--verify", "b.json"}).out,
              HasSubstr("another patient's number"));
  const std::string own = recorded("ALPHA-1");
  EXPECT_THAT(made(own, "own.html"), Not(HasSubstr("CAUTION")));
  EXPECT_THAT(read_text(folder() / "own.html"), HasSubstr("CT and case state the same number"));
  // Of a case without a subject nothing is known.
  EXPECT_EQ(nlohmann::json::parse(made(case_.string(), "d.json", {"--json"}))["one_patient"], nullptr);
}

// The case's first line says by which plan it was recorded; what the document says beside it is its maker's.
TEST_F(CompareProgram, OfWhetherTheCaseNamesThePlanTheCaseIsAsked) {
  ASSERT_FALSE(compare("out.json").empty());
  std::string text = read_text(folder() / "out.json");
  const std::size_t at = text.find("\"names_plan\": true");
  ASSERT_NE(at, std::string::npos);
  write_text(folder() / "out.json", text.replace(at, 18, "\"names_plan\": null"));
  const ProcessResult told = kiroku({"compare", case_.string(), "plan.json", "--verify", "out.json"});
  EXPECT_EQ(told.status, 1);
  EXPECT_THAT(told.out, HasSubstr("names a plan, and the comparison says that it names none"));
  EXPECT_THAT(told.out, Not(HasSubstr("The case names no plan")));
}

TEST_F(CompareProgram, SaysWhatItCannotDo) {
  EXPECT_REFUSED(kiroku({"compare", case_.string()}), "name the case and the plan");
  fs::copy(case_, folder() / "copy", fs::copy_options::recursive);
  EXPECT_REFUSED(kiroku({"compare", "copy", "plan.json"}), "is not in the archive of");
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "out.avi"}), "must end in .mp4");
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "out.json", "--stream", "vitals"}),
                 "has no pictures");
  // Nobody marked anything.
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "out.mp4"}),
                 "no step of the plan was found");
  EXPECT_FALSE(fs::exists(folder() / "out.mp4"));
  write_text(folder() / "wrong.json", R"({"steps": [{"step": 4, "start": "00:00:01"}]})");
  EXPECT_REFUSED(
      kiroku({"compare", case_.string(), "plan.json", "-o", "out.json", "--by-hand", "wrong.json"}),
      "steps[0].step is 4: the plan's steps are 1 to 3");
  write_text(folder() / "wrong.json", R"({"tools": {"hook": [{"at": "00:00:01", "pixel": [1, 2]}]}})");
  EXPECT_REFUSED(
      kiroku({"compare", case_.string(), "plan.json", "-o", "out.json", "--by-hand", "wrong.json"}),
      "is for a tool that the plan does not have");
  write_text(folder() / "few.json",
             R"({"steps": [{"step": 2, "start": "00:00:00"}],
                 "registration": {"at": "00:00:01", "field_deg": 35, "points": [{"organ": [0, 0, 0], "pixel": [1, 2]}]}})");
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "out.json", "--by-hand", "few.json"}),
                 "pick at least 4");
  EXPECT_REFUSED(kiroku({"compare", "--verify", "plan.json"}), "plan.json is no comparison");
  // A plan is not written over, however much is insisted.
  EXPECT_REFUSED(kiroku({"compare", case_.string(), "plan.json", "-o", "plan.json", "--force"}),
                 "plan.json is no comparison");
}

/// As OpenCV writes one.
std::string lens_text(int width, int height, const std::string& k1) {
  const auto number = [](double value) { return std::to_string(value); };
  return "%YAML:1.0\n---\nimage_width: " + std::to_string(width) +
         "\nimage_height: " + std::to_string(height) +
         "\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ " +
         number(0.9 * width) + ", 0., " + number((width - 1) / 2.0) + ", 0., " + number(0.9 * width) + ", " +
         number((height - 1) / 2.0) +
         ", 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   "
         "data: [ " +
         k1 + ", 0.02, 0.0004, -0.0003, 0. ]\n";
}

TEST_F(CompareProgram, TakesTheLensOfTheEndoscopeIntoTheDocument) {
  write_text(folder() / "endoscope.yml", lens_text(320, 240, "-0.25"));
  const Arguments align{"--align", "auto", "--lens", "endoscope.yml"};
  const nlohmann::json made = compare("out.json", align);
  const nlohmann::json document = nlohmann::json::parse(read_text(folder() / "out.json"));
  const nlohmann::json& told = document["organ_alignment"];
  EXPECT_EQ(told["picture_sizes"][0]["width"], 160) << "a lens of twice as large pictures is scaled";
  const nlohmann::json& lens = told["lens"];
  EXPECT_EQ(lens["file"]["name"], "endoscope.yml");
  EXPECT_EQ(lens["file"]["sha256"], made["aligned"]["lens_sha256"]);
  EXPECT_EQ(lens["file"]["bytes"], fs::file_size(folder() / "endoscope.yml"));
  EXPECT_EQ(lens["model"], "brown");
  EXPECT_EQ(lens["coefficients"], nlohmann::json::parse("[-0.25, 0.02, 0.0004, -0.0003, 0.0]"));
  EXPECT_GT(told["field_deg"].get<double>(), 45);
  EXPECT_LT(told["field_deg"].get<double>(), 50);
  EXPECT_GT(
      compare("out.mp4", {"--align", "auto", "--lens", "endoscope.yml", "--show", "overlay"})["pictures"],
      10);
  const ProcessResult said = kiroku({"compare", case_.string(), "plan.seal.json", "-o", "said.json",
                                     "--by-hand", "hand.json", "--align", "auto", "--lens", "endoscope.yml"});
  EXPECT_THAT(said.out, HasSubstr("by the lens endoscope.yml: barrel distortion of "));
  // Without one nothing is said of it.
  EXPECT_GT(compare("field.json", {"--align", "auto", "--field", "47"})["aligned"]["pictures"], 5);
  EXPECT_THAT(read_text(folder() / "field.json"), Not(HasSubstr("\"lens\"")));
}

TEST_F(CompareProgram, SaysWhatIsWrongWithALens) {
  const auto asked = [&](const Arguments& more) {
    Arguments arguments{"compare",  case_.string(), "plan.seal.json", "-o",
                        "out.json", "--by-hand",    "hand.json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return kiroku(arguments);
  };
  const auto with_lens = [&](const std::string& text) {
    write_text(folder() / "lens.yml", text);
    return asked({"--align", "auto", "--lens", "lens.yml"});
  };
  EXPECT_REFUSED(with_lens("hello"), "lens.yml cannot be read as YAML, XML or JSON of OpenCV's FileStorage");
  EXPECT_REFUSED(with_lens(lens_text(320, 180, "-0.25")), "the recorded pictures have 160x120 pixels");
  EXPECT_REFUSED(with_lens(lens_text(160, 120, ".NaN")),
                 "lens.yml: the lens has a number that is infinite or none");
  EXPECT_REFUSED(with_lens(lens_text(160, 120, "-2.5")), "lens.yml: the lens's distortion is not monotone");
  write_text(folder() / "lens.yml", lens_text(160, 120, "-0.25"));
  EXPECT_REFUSED(asked({"--lens", "lens.yml"}), "--lens is for --align auto");
  EXPECT_REFUSED(asked({"--align", "auto", "--lens", "lens.yml", "--field", "60"}),
                 "--field and --lens both say");
  EXPECT_REFUSED(asked({"--align", "auto"}), "or give its calibration with --lens");
  EXPECT_REFUSED(asked({"--align", "auto", "--lens", "none.yml"}), "none.yml");
  EXPECT_FALSE(fs::exists(folder() / "out.json"));
}

TEST_F(CompareProgram, WritesWhatWasFoundForEditing) {
  const ProcessResult written = kiroku(
      {"compare", case_.string(), "plan.json", "--by-hand", "hand.json", "--write-by-hand", "again.json"});
  EXPECT_EQ(written.status, 0) << written.err;
  EXPECT_EQ(
      nlohmann::json::parse(read_text(folder() / "again.json"))["steps"][0],
      nlohmann::json::parse(R"({"step": 3, "name": "hold", "start": "00:00:00.1", "end": "00:00:00.6"})"));
  EXPECT_EQ(
      kiroku({"compare", case_.string(), "plan.json", "--by-hand", "again.json", "-o", "out.json"}).status,
      0);
}

}  // namespace
}  // namespace kiroku::test
