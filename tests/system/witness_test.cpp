// Witnesses of an appliance log, by the programs that people run.
#include <filesystem>
#include <memory>
#include <sys/stat.h>

#include "tests/support/build_paths.h"
#include "tests/system/program_test.h"

namespace kiroku::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

class Witnesses : public ProgramTest {
 protected:
  void SetUp() override {
    make_demo_home();
    EXPECT_FALSE(record().empty());
    std::string policy = "# two of three\n";
    for (const std::string name : {"a", "b", "c"}) {
      const std::string folder = path("witness-" + name);
      // One of the three signs by Ed25519, the others by what is the default.
      Arguments init{"witness", "init", folder, "--name", name + ".example/w", "--json"};
      if (name == "b") init.insert(init.end(), {"--algorithm", "ed25519"});
      const nlohmann::json made = kiroku_json(init);
      EXPECT_EQ(kiroku({"witness", "trust", folder, (home() / "device.pub").string()}).status, 0);
      policy += "witness " + name + " " + made["key"].get<std::string>();
      // c is away.
      policy += " " + (name == "c" ? "http://127.0.0.1:1/" : serve(name)) + "\n";
    }
    write_text(home() / "witnesses.txt", policy + "group two 2 a b c\nquorum two\n");
    write_text(folder() / "witnesses.txt", policy + "group two 2 a b c\nquorum two\n");
  }
  /// Its address.
  std::string serve(const std::string& name) {
    served_.push_back(std::make_unique<Process>(
        options({"witness", "serve", path("witness-" + name), "--listen", "127.0.0.1:0", "--json"})));
    EXPECT_TRUE(served_.back()->wait_for("}\n"));
    return nlohmann::json::parse(served_.back()->out())["url"];
  }
  [[nodiscard]] Arguments ask(const Arguments& more = {}) const {
    Arguments all{"witness", "ask"};
    all.insert(all.end(), more.begin(), more.end());
    return all;
  }
  static inline const Arguments kVerify{"log", "--verify", "--witnesses", "witnesses.txt"};

  std::vector<std::unique_ptr<Process>> served_;
};

TEST_F(Witnesses, CosignTheLogAndTheVerifierSaysWho) {
  const ProcessResult before = kiroku(kVerify);
  EXPECT_EQ(before.status, 3) << before.out;
  EXPECT_THAT(before.out, HasSubstr("Witnesses: nothing shows that anybody cosigned this log."));

  const ProcessResult asked = kiroku(ask());
  EXPECT_EQ(asked.status, 0) << asked.out << asked.err;
  EXPECT_THAT(asked.out, HasSubstr("a.example/w: cosigned\n"));
  EXPECT_THAT(asked.out, HasSubstr("c.example/w: did not answer"));
  EXPECT_THAT(asked.out, HasSubstr("are witnessed as the policy asks"));

  const ProcessResult told = kiroku(kVerify);
  EXPECT_EQ(told.status, 0) << told.out;
  EXPECT_THAT(told.out, HasSubstr("witnessed as the policy asks"));
  EXPECT_THAT(told.out, HasSubstr("  b.example/w cosigned, at "));
  EXPECT_THAT(told.out, HasSubstr("  c.example/w did not cosign\n"));
  // The log grows, and is witnessed again.
  EXPECT_FALSE(record().empty());
  const nlohmann::json again = kiroku_json(ask({"--json"}));
  EXPECT_TRUE(again["quorum"]);
  Arguments as_json = kVerify;
  as_json.emplace_back("--json");
  const nlohmann::json judged = kiroku_json(as_json)["witnesses"];
  EXPECT_TRUE(judged["quorum"]);
  EXPECT_EQ(judged["entries"], again["entries"]);
  EXPECT_EQ(judged["witnesses"].size(), 3U);

  const nlohmann::json known = kiroku_json({"witness", "logs", path("witness-a"), "--json"});
  EXPECT_EQ(known["logs"][0]["size"], again["entries"]);
}

TEST_F(Witnesses, ACopyFromBeforeIsToldAndASecondHistoryIsNotCosigned) {
  // Whoever holds the device's key keeps a copy of the home, lets the log be witnessed, and goes on from the
  // copy.
  fs::copy(home(), folder() / "copy", fs::copy_options::recursive);
  EXPECT_FALSE(record().empty());
  ASSERT_EQ(kiroku(ask()).status, 0);
  const auto in_copy = [&](Arguments arguments) {
    arguments.insert(arguments.end(), {"--home", path("copy")});
    return kiroku(arguments);
  };
  const ProcessResult older = in_copy(ask());
  EXPECT_EQ(older.status, 3);
  EXPECT_THAT(older.out, HasSubstr("this is a copy from before, or entries were taken away"));
  EXPECT_FALSE(fs::exists(folder() / "copy/witnessed/log.note"));
  // Grown beyond what was witnessed, it is another history.
  for (int i = 0; i < 3; ++i) {
    ASSERT_EQ(in_copy({"record", "--json", "--duration", "00:00:01", "--endoscope",
                       "synthetic:endoscope?size=64x48&rate=10&speed=max"})
                  .status,
              0);
  }
  const ProcessResult forked = in_copy(ask());
  EXPECT_EQ(forked.status, 3) << forked.out;
  EXPECT_THAT(forked.out, HasSubstr("answered 422"));
  EXPECT_THAT(forked.out, HasSubstr("NOT witnessed as the policy asks"));
  // The cosigned note of the true log does not vouch for the other one.
  Arguments borrowed = kVerify;
  borrowed.insert(borrowed.end(), {"--against", (home() / "witnessed/log.note").string()});
  const ProcessResult judged = in_copy(borrowed);
  EXPECT_EQ(judged.status, 1) << judged.out;
  EXPECT_THAT(judged.out, HasSubstr("outside-note-forked"));
  EXPECT_THAT(judged.out, HasSubstr("was not signed of the entries that this log begins with"));
}

// The device's own signature is on what was cosigned: a log that is not that one is not whole.
TEST_F(Witnesses, ALogThatIsShorterThanWhatTheHomesNoteIsOfIsTampered) {
  fs::copy(home() / "archive/log", folder() / "before", fs::copy_options::recursive);
  EXPECT_FALSE(record().empty());
  ASSERT_EQ(kiroku(ask()).status, 0);
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
  fs::remove_all(home() / "archive/log");
  fs::rename(folder() / "before", home() / "archive/log");
  for (const Arguments& arguments : {kVerify, Arguments{"log", "--verify"}}) {
    const ProcessResult cut = kiroku(arguments);
    EXPECT_EQ(cut.status, 1) << cut.out;
    EXPECT_THAT(cut.out, HasSubstr("outside-note-rolled-back"));
  }
  EXPECT_THAT(kiroku(kVerify).out, HasSubstr("Entries were taken away, or this is a copy from before"));
}

// A log that was cut back behind a hold would let its case be erased, as if nobody had ever held it.
TEST_F(Witnesses, OfALogThatWasCutBackNobodyCanTellWhatIsUnderLegalHold) {
  const std::string held = record().filename().string();
  fs::copy(home() / "archive/log", folder() / "before", fs::copy_options::recursive);
  ASSERT_EQ(kiroku({"hold", held, "--reason", "court"}).status, 0);
  ASSERT_EQ(kiroku(ask()).status, 0);
  EXPECT_THAT(kiroku({"hold", "--list"}).out, HasSubstr("court"));
  fs::remove_all(home() / "archive/log");
  fs::rename(folder() / "before", home() / "archive/log");
  for (const Arguments& asked :
       {Arguments{"hold", "--list"}, Arguments{"release", held, "--reason", "settled"},
        Arguments{"erase", held, "--stream", "endoscope", "--policy", "p", "--only-copy"}}) {
    const ProcessResult told = kiroku(asked);
    EXPECT_EQ(told.status, 2) << told.out;
    EXPECT_THAT(told.err, HasSubstr("does not go on from the "));
    EXPECT_THAT(told.err, HasSubstr("nobody can tell which cases are under legal hold"));
  }
  EXPECT_FALSE(fs::is_empty(home() / "archive" / held / "segments/endoscope"));
}

TEST_F(Witnesses, APipeInThePlaceOfTheHomesNoteKeepsTheLogFromNothing) {
  fs::create_directories(home() / "witnessed");
  ASSERT_EQ(::mkfifo((home() / "witnessed/log.note").c_str(), 0600), 0);
  const ProcessResult judged = kiroku({"log", "--verify"});
  EXPECT_EQ(judged.status, 0) << judged.out;
  EXPECT_THAT(judged.err, HasSubstr("is no file, so the log was not compared with it"));
  EXPECT_EQ(kiroku(kVerify).status, 3);
}

TEST_F(Witnesses, HowMuchOfTheLogNobodyWitnessedIsSaid) {
  ASSERT_EQ(kiroku(ask()).status, 0);
  EXPECT_THAT(kiroku(kVerify).out, testing::Not(HasSubstr("only the device speaks")));
  EXPECT_FALSE(record().empty());
  EXPECT_THAT(kiroku(kVerify).out, HasSubstr("behind them only the device speaks: from 20"));
  Arguments as_json = kVerify;
  as_json.emplace_back("--json");
  const nlohmann::json judged = kiroku_json(as_json)["witnesses"];
  EXPECT_GT(judged["log_entries"], judged["entries"]);
  EXPECT_THAT(judged["unwitnessed_since"].get<std::string>(), testing::StartsWith("20"));
}

// It would cosign a second history of every log that it is told of again.
TEST_F(Witnesses, OneThatLostItsMemoryDoesNotBeginAnew) {
  const std::string folder = path("witness-a");
  served_.clear();
  fs::resize_file(fs::path(folder) / "witness.sqlite", 0);
  const Arguments trust{"witness", "trust", folder, (home() / "device.pub").string()};
  EXPECT_REFUSED(kiroku(trust), "make a new one with 'kiroku witness init'");
  fs::remove(fs::path(folder) / "witness.sqlite");
  EXPECT_REFUSED(kiroku(trust), "make a new one with 'kiroku witness init'");
  EXPECT_REFUSED(kiroku({"witness", "serve", folder}), "make a new one with 'kiroku witness init'");
  EXPECT_FALSE(fs::exists(fs::path(folder) / "witness.sqlite"));
}

TEST_F(Witnesses, ANoteWithItsQuorumStaysWhereANewerOneLacksIt) {
  ASSERT_EQ(kiroku(ask()).status, 0);
  const std::string kept = read_text(home() / "witnessed/log.note");
  served_.pop_back();
  EXPECT_FALSE(record().empty());
  const ProcessResult asked = kiroku(ask());
  EXPECT_EQ(asked.status, 3);
  EXPECT_THAT(asked.out, HasSubstr("the note that was kept before stays"));
  EXPECT_EQ(read_text(home() / "witnessed/log.note"), kept);
  EXPECT_EQ(kiroku(kVerify).status, 0) << "its entries are witnessed, if not the newest ones";
}

TEST_F(Witnesses, ProveNothingByAnAlgorithmThatEnded) {
  ASSERT_EQ(kiroku(ask()).status, 0);
  write_text(folder() / "algorithms.toml",
             "[[algorithm]]\nname = \"sha256\"\n[[algorithm]]\nname = \"ed25519\"\nuntil = 2025-12-31\n");
  Arguments later = kVerify;
  later.insert(later.end(), {"--policy", "algorithms.toml"});
  const ProcessResult told = kiroku(later);
  EXPECT_EQ(told.status, 3);
  EXPECT_THAT(told.out, HasSubstr("NOT witnessed as the policy asks"));
  EXPECT_THAT(told.out, HasSubstr("cosignatures prove nothing any more"));
}

TEST_F(Witnesses, AreFoundByASecondImplementationAsWell) {
  if (!has_tool("python3")) GTEST_SKIP() << "python3 is not installed";
  ASSERT_EQ(kiroku(ask()).status, 0);
  const auto found_in = [&](const std::string& note) {
    write_text(folder() / "found.note", note);
    return tool({"python3", (source_folder() / "tests/foreign/cosignature.py").string(), path("found.note"),
                 path("witnesses.txt")})
        .out;
  };
  const std::string note = read_text(home() / "witnessed/log.note");
  EXPECT_THAT(found_in(note), testing::MatchesRegex("a.example/w cosigned [0-9]+\nb.example/w cosigned "
                                                    "[0-9]+\nc.example/w absent\n"));
  // One character of a's signature, ML-DSA's, becomes another of base64's alphabet.
  std::string changed = note;
  char& character = changed[changed.find("a.example/w ") + 1000];
  character = character == 'A' ? 'B' : 'A';
  EXPECT_THAT(found_in(changed), HasSubstr("a.example/w invalid\nb.example/w cosigned"));
}

TEST_F(Witnesses, ByMlDsaCountOnWhereEd25519Ended) {
  ASSERT_EQ(kiroku(ask()).status, 0);
  write_text(folder() / "algorithms.toml",
             "[[algorithm]]\nname = \"sha256\"\n[[algorithm]]\nname = \"ml-dsa-44\"\n"
             "[[algorithm]]\nname = \"ed25519\"\nuntil = 2025-12-31\n");
  const std::string witnesses = read_text(folder() / "witnesses.txt");
  write_text(folder() / "a-alone.txt",
             witnesses.substr(0, witnesses.find("group")) + "group one any a\nquorum one\n");
  const auto told_by = [&](const std::string& policy) {
    return kiroku({"log", "--verify", "--witnesses", policy, "--policy", "algorithms.toml"}).out;
  };
  // b signs by Ed25519: of the two that cosigned, one counts.
  EXPECT_THAT(told_by("witnesses.txt"), HasSubstr("NOT witnessed as the policy asks"));
  EXPECT_THAT(told_by("witnesses.txt"), HasSubstr("cosignatures by Ed25519 prove nothing any more"));
  EXPECT_THAT(told_by("a-alone.txt"), HasSubstr(" witnessed as the policy asks"));
  EXPECT_THAT(told_by("a-alone.txt"), testing::Not(HasSubstr("NOT witnessed")));
}

TEST_F(Witnesses, OneOfThreeIsNotEnough) {
  served_.pop_back();
  const ProcessResult asked = kiroku(ask());
  EXPECT_EQ(asked.status, 3);
  EXPECT_THAT(asked.out, HasSubstr("NOT witnessed as the policy asks"));
  const ProcessResult told = kiroku(kVerify);
  EXPECT_EQ(told.status, 3);
  EXPECT_THAT(told.out, HasSubstr("NOT witnessed as the policy asks"));
  EXPECT_THAT(told.out, HasSubstr("a.example/w cosigned"));
  // Without a policy the log is as whole as it was.
  EXPECT_EQ(kiroku({"log", "--verify"}).status, 0);
}

// What travels with a receipt: the case and a proof, without the log, to somebody who has neither home nor
// network.
TEST_F(Witnesses, OfACaseAreJudgedByItsProofWithoutTheLog) {
  const fs::path recorded = record();
  const std::string proof = path("case.tlog-proof");
  ASSERT_EQ(kiroku(ask()).status, 0);
  const nlohmann::json made = kiroku_json({"log", "prove", recorded.string(), "-o", proof, "--json"});
  EXPECT_EQ(made["checkpoint"], (home() / "witnessed/log.note").string());
  EXPECT_THAT(read_text(proof), testing::StartsWith("c2sp.org/tlog-proof@v1\nextra "));
  EXPECT_REFUSED(kiroku({"log", "prove", recorded.string(), "-o", proof}), "is there already");

  const fs::path elsewhere = folder() / "elsewhere" / recorded.filename();
  fs::create_directories(elsewhere.parent_path());
  fs::copy(recorded, elsewhere, fs::copy_options::recursive);
  const auto verify = [&](const Arguments& more) {
    Arguments all{
        built_file("kiroku-verify"),      elsewhere.string(), "--device",
        (home() / "device.pub").string(), "--own-authority",  (home() / "own-authority.pem").string()};
    all.insert(all.end(), more.begin(), more.end());
    return tool(all);
  };
  const ProcessResult told = verify({"--proof", proof, "--witnesses", path("witnesses.txt")});
  EXPECT_EQ(told.status, 0) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("log-proof-holds"));
  EXPECT_THAT(told.out, HasSubstr("witnessed as the policy asks (" + proof + ")"));
  EXPECT_THAT(told.out, HasSubstr("the case's end is among them"));
  EXPECT_THAT(told.out, HasSubstr("b.example/w cosigned, at "));
  EXPECT_THAT(told.out, HasSubstr("c.example/w did not cosign"));
  const nlohmann::json as_json =
      nlohmann::json::parse(verify({"--proof", proof, "--witnesses", path("witnesses.txt"), "--json"}).out);
  EXPECT_TRUE(as_json["witnesses"]["quorum"]);
  EXPECT_EQ(as_json["witnesses"]["holds"], "end");
  EXPECT_EQ(as_json["witnesses"]["witnesses"].size(), 3U);

  // The verdict is the same without witnesses, and too few of them change the exit status alone.
  const nlohmann::json plain = nlohmann::json::parse(verify({"--json"}).out);
  EXPECT_EQ(plain["verdict"], as_json["verdict"]);
  EXPECT_TRUE(plain["witnesses"].is_null());
  std::string all_three = read_text(folder() / "witnesses.txt");
  all_three.replace(all_three.find("group two 2"), 11, "group two 3");
  write_text(folder() / "three.txt", all_three);
  const ProcessResult few = verify({"--proof", proof, "--witnesses", path("three.txt")});
  EXPECT_EQ(few.status, 3) << few.out;
  EXPECT_THAT(few.out, HasSubstr("NOT witnessed as the policy asks"));
  EXPECT_THAT(few.out, HasSubstr("INTACT"));
  const ProcessResult without = verify({"--witnesses", path("witnesses.txt")});
  EXPECT_EQ(without.status, 3) << without.out;
  EXPECT_THAT(without.out, HasSubstr("nothing shows that anybody cosigned"));

  // The receipt carries the proof along: whoever has the page, the policy and the case needs nothing else.
  if (has_tool("pdfdetach")) {
    ASSERT_EQ(kiroku({"report", recorded.string(), "--receipt", "-o", path("receipt.pdf")}).status, 0);
    ASSERT_EQ(
        tool({"pdfdetach", "-save", "2", "-o", path("from-receipt.tlog-proof"), path("receipt.pdf")}).status,
        0);
    EXPECT_EQ(read_text(path("from-receipt.tlog-proof")), read_text(proof));
  }

  // A proof of another case is not used; one that was changed shows nothing.
  const fs::path second = record();
  EXPECT_EQ(kiroku({"log", "prove", second.string(), "-o", path("second.tlog-proof")}).status, 0);
  const ProcessResult other = verify({"--proof", path("second.tlog-proof")});
  EXPECT_EQ(other.status, 3) << other.out;
  EXPECT_THAT(other.out, HasSubstr("log-proof-not-used"));
  EXPECT_THAT(other.out, HasSubstr("it is of case " + second.filename().string()));
}

TEST_F(Witnesses, OfACaseInTheHomeAreThoseOfItsNewestNote) {
  const std::string before = record().string();
  ASSERT_EQ(kiroku(ask()).status, 0);
  const std::string after = record().string();
  const ProcessResult told = kiroku({"verify", before, "--witnesses", "witnesses.txt"});
  EXPECT_EQ(told.status, 0) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("the case's end is among them"));
  // The checkpoint was cosigned before this case began.
  const ProcessResult later = kiroku({"verify", after, "--witnesses", "witnesses.txt"});
  EXPECT_EQ(later.status, 3) << later.out;
  EXPECT_THAT(later.out, HasSubstr("entries of the log say nothing of the case"));
  EXPECT_EQ(kiroku({"verify", after}).status, 0);
  // A proof takes the log's own checkpoint where no cosigned one holds the entry.
  EXPECT_THAT(kiroku({"log", "prove", after, "-o", path("after.tlog-proof")}).out,
              HasSubstr("archive/log/checkpoints/"));
  // The report says it in both languages.
  for (const auto& [language, words] :
       {std::pair("en", "are witnessed as the policy that was given asks"), std::pair("ja", "証人が連署")}) {
    const std::string report = path(std::string("report-") + language + ".html");
    EXPECT_EQ(kiroku({"report", before, "--witnesses", "witnesses.txt", "--language", language, "-o", report})
                  .status,
              0);
    EXPECT_THAT(read_text(report), HasSubstr(words));
    EXPECT_THAT(read_text(report), HasSubstr("b.example/w"));
  }
}

TEST_F(Witnesses, AnExcerptTravelsWithItsProof) {
  const fs::path recorded = record();
  ASSERT_EQ(kiroku(ask()).status, 0);
  ASSERT_EQ(
      kiroku({"excerpt", recorded.string(), "--from", "0", "--to", "00:00:01", "-o", path("part")}).status,
      0);
  ASSERT_EQ(kiroku({"log", "prove", path("part"), "-o", path("part.tlog-proof")}).status, 0);
  const Arguments verify{"verify", "--excerpt", path("part"), "--witnesses", "witnesses.txt", "--proof"};
  const auto by = [&](const std::string& proof) {
    Arguments all = verify;
    all.push_back(proof);
    return kiroku(all);
  };
  const ProcessResult told = by(path("part.tlog-proof"));
  EXPECT_EQ(told.status, 0) << told.out << told.err;
  EXPECT_THAT(told.out, HasSubstr("log-proof-holds"));
  EXPECT_THAT(told.out, HasSubstr("the case's end is among them"));
}

TEST_F(Witnesses, RefuseInASentence) {
  EXPECT_REFUSED(kiroku({"witness", "init", path("witness-a"), "--name", "x"}), "there is a witness in");
  EXPECT_REFUSED(kiroku({"witness", "init", path("new"), "--name", "two words"}), "cannot name a key");
  EXPECT_REFUSED(kiroku({"witness", "init", path("new"), "--name", "w", "--algorithm", "rsa"}), "ml-dsa-44");
  EXPECT_REFUSED(kiroku({"witness", "init", path("new"), "--name", std::string(256, 'w')}),
                 "at most 255 bytes");
  EXPECT_FALSE(fs::exists(folder() / "new"));
  EXPECT_REFUSED(kiroku({"witness", "serve", path("nothing")}), "'kiroku witness init' makes one");
  EXPECT_REFUSED(kiroku({"witness", "trust", path("witness-a"), "nonsense"}), "is no verifier key");
  EXPECT_REFUSED(kiroku({"log", "--witnesses", "witnesses.txt"}), "give --verify, too");
  write_text(folder() / "none.txt", "quorum none\n");
  EXPECT_REFUSED(kiroku({"witness", "ask", "--witnesses", "none.txt"}),
                 "no witness of none.txt has an address");
  EXPECT_REFUSED(kiroku({"witness", "ask", "--witnesses", "absent.txt"}), "absent.txt");
  fs::permissions(folder() / "witness-a/witness.key", fs::perms::owner_all | fs::perms::group_read);
  EXPECT_REFUSED(kiroku({"witness", "serve", path("witness-a")}), "others than its owner");
}

}  // namespace
}  // namespace kiroku::test
