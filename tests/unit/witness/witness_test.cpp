#include "witness/witness.h"

#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/encoding.h"
#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"
#include "tests/support/moved_clock.h"
#include "tests/support/temporary_folder.h"
#include "witness/cosigning.h"
#include "witness/submission.h"
#include "witness/witness_server.h"

namespace kiroku::witness {
namespace {

using testing::HasSubstr;
using testing::StartsWith;
using State = crypto::CosignatureCheck::State;

std::filesystem::path made(const std::filesystem::path& file) {
  Store::make(file);
  return file;
}

/// A log of numbered lines that can be shown at any size.
class Witnessed : public testing::Test {
 protected:
  explicit Witnessed(std::uint64_t lines = 40,
                     crypto::CosignatureAlgorithm algorithm = crypto::CosignatureAlgorithm::kEd25519)
      : key(crypto::CosigningKey::generate(algorithm)) {
    for (std::uint64_t i = 0; i < lines; ++i)
      tree.append(crypto::merkle_leaf_hash(bytes_of("line " + std::to_string(i))));
    store.add_key(kOrigin, {"or-1", log_key.public_key()});
  }
  [[nodiscard]] std::string note(std::uint64_t size, const std::string& origin = kOrigin) const {
    return crypto::sign_note(crypto::Checkpoint{origin, size, tree.root(size)}.to_text(), "or-1", log_key);
  }
  [[nodiscard]] Submission submission(std::uint64_t from, std::uint64_t size) const {
    Submission made;
    made.old_size = from;
    if (from > 0) made.proof = tree.consistency_proof(from, size);
    made.note = note(size);
    return made;
  }
  Answer add(std::uint64_t from, std::uint64_t size) {
    return witness.add_checkpoint(submission(from, size).to_text());
  }

  static constexpr const char* kOrigin = "kiroku/or-1/log";
  const test::TemporaryFolder folder;
  crypto::MerkleTree tree;
  const crypto::SigningKey log_key = crypto::SigningKey::generate();
  const crypto::CosigningKey key;
  Store store{made(folder / "witness.sqlite")};
  test::MovedClock time;
  Witness witness{store, "w.example/1", key, time};
};

TEST_F(Witnessed, CosignsWhatGoesOn) {
  for (const auto& [from, size] :
       std::vector<std::pair<std::uint64_t, std::uint64_t>>{{0, 7}, {7, 7}, {7, 8}, {8, 40}}) {
    const Answer answer = add(from, size);
    ASSERT_EQ(answer.status, 200) << answer.body;
    const auto check = crypto::check_cosignature(note(size) + answer.body, witness.key());
    EXPECT_EQ(check.state, State::kValid);
    EXPECT_EQ(check.time_s, 1'785'920'400U);
    EXPECT_EQ(store.log(kOrigin)->latest->size, size);
  }
}

TEST_F(Witnessed, AnswersAsTheSpecificationSays) {
  const auto status = [&](const std::string& body) { return witness.add_checkpoint(body).status; };
  const auto with = [&](auto&& change) {
    Submission made = submission(7, 20);
    change(made);
    return status(made.to_text());
  };
  ASSERT_EQ(add(0, 7).status, 200);
  // 400: no submission at all, or an old size above the new one.
  for (const std::string body :
       {"", "old 7\n", "old 07\n\n", "old -1\n\n", "new 7\n\n", "old 7\nnot base64\n\n"})
    EXPECT_EQ(status(body + note(20)), 400) << body;
  EXPECT_EQ(status("old 7\n\nno note"), 400);
  EXPECT_EQ(with([&](Submission& s) { s.proof.resize(64); }), 400);
  EXPECT_EQ(with([&](Submission& s) { s.old_size = 21; }), 400);
  // 404: a log that is not known.
  EXPECT_EQ(with([&](Submission& s) { s.note = note(20, "kiroku/or-2/log"); }), 404);
  // 403: no key of the log signed, or one did wrongly.
  const std::string text = crypto::Checkpoint{kOrigin, 20, tree.root(20)}.to_text();
  const crypto::SigningKey stranger = crypto::SigningKey::generate();
  EXPECT_EQ(with([&](Submission& s) { s.note = crypto::sign_note(text, "or-1", stranger); }), 403);
  EXPECT_EQ(with([&](Submission& s) { s.note = crypto::sign_note(text, "or-2", log_key); }), 403);
  EXPECT_EQ(with([&](Submission& s) {
              s.note.replace(0, text.size(), crypto::Checkpoint{kOrigin, 21, tree.root(20)}.to_text());
            }),
            403);
  // 409: it knows another size, and says which.
  EXPECT_EQ(add(0, 20).status, 409);
  const Answer conflict = add(8, 20);
  EXPECT_EQ(conflict.status, 409);
  EXPECT_EQ(conflict.body, "7\n");
  EXPECT_EQ(conflict.content_type, "text/x.tlog.size");
  // 422: a proof that does not hold.
  EXPECT_EQ(with([&](Submission& s) { s.proof.pop_back(); }), 422);
  EXPECT_EQ(with([&](Submission& s) { s.proof.back()[0] ^= std::byte{1}; }), 422);
  EXPECT_EQ(with([&](Submission& s) { s.proof.clear(); }), 422);
  EXPECT_EQ(store.log(kOrigin)->latest->size, 7U) << "nothing of this was remembered";
  EXPECT_EQ(with([](Submission&) {}), 200);
}

TEST_F(Witnessed, RefusesASecondHistory) {
  ASSERT_EQ(add(0, 20).status, 200);
  crypto::MerkleTree other;
  for (std::uint64_t i = 0; i < 40; ++i)
    other.append(crypto::merkle_leaf_hash(bytes_of("forged " + std::to_string(i))));
  const auto forged = [&](std::uint64_t size) {
    return crypto::sign_note(crypto::Checkpoint{kOrigin, size, other.root(size)}.to_text(), "or-1", log_key);
  };
  Submission made;
  made.note = forged(20);
  made.old_size = 20;
  EXPECT_EQ(witness.add_checkpoint(made.to_text()).status, 422) << "another root of the same size";
  made.note = forged(30);
  made.proof = other.consistency_proof(20, 30);
  EXPECT_EQ(witness.add_checkpoint(made.to_text()).status, 422);
  made.old_size = 0;
  made.proof.clear();
  EXPECT_EQ(witness.add_checkpoint(made.to_text()).status, 409) << "it does not begin anew";
  // Nor does it go back.
  made.old_size = 20;
  made.note = note(19);
  EXPECT_EQ(witness.add_checkpoint(made.to_text()).status, 400);
  EXPECT_EQ(add(19, 20).status, 409);
}

TEST_F(Witnessed, AnEmptyTreeHasTheRootOfNothing) {
  const auto empty = [&](const crypto::Sha256Digest& root) {
    return "old 0\n\n" + crypto::sign_note(crypto::Checkpoint{kOrigin, 0, root}.to_text(), "or-1", log_key);
  };
  EXPECT_EQ(witness.add_checkpoint(empty(tree.root(1))).status, 422);
  EXPECT_EQ(witness.add_checkpoint(empty(crypto::MerkleFrontier().root())).status, 200);
  Submission with_proof = submission(7, 20);
  with_proof.old_size = 0;
  EXPECT_EQ(witness.add_checkpoint(with_proof.to_text()).status, 422)
      << "nothing is to be proved from nothing";
  EXPECT_EQ(add(0, 5).status, 200);
}

TEST_F(Witnessed, IgnoresSignaturesOfOthers) {
  Submission made = submission(0, 7);
  made.note += crypto::signature_line("or-1", 1234, Bytes(64));  // another algorithm of the same name
  made.note += crypto::signature_line("somebody", 1, Bytes(64));
  EXPECT_EQ(witness.add_checkpoint(made.to_text()).status, 200);
  EXPECT_THAT(store.log(kOrigin)->latest->note, testing::Not(HasSubstr("somebody")));
}

TEST_F(Witnessed, ShowsMonitorsTheNewestCheckpoint) {
  const std::string hash = crypto::to_hex(crypto::sha256(bytes_of(kOrigin)));
  EXPECT_EQ(witness.checkpoint(hash).status, 404);
  add(0, 7);
  add(7, 20);
  const Answer shown = witness.checkpoint(hash);
  ASSERT_EQ(shown.status, 200);
  const crypto::OpenedNote opened = crypto::open_note(shown.body, {{"or-1", log_key.public_key()}});
  EXPECT_FALSE(opened.failure);
  EXPECT_EQ(crypto::Checkpoint::parse(opened.text)->size, 20U);
  EXPECT_EQ(crypto::check_cosignature(shown.body, witness.key()).state, State::kValid);
  EXPECT_EQ(witness.checkpoint("00").status, 404);
}

TEST_F(Witnessed, OfTwoAtOnceOneIsRefused) {
  ASSERT_EQ(add(0, 7).status, 200);
  // Both were judged before either was stored.
  EXPECT_TRUE(store.advance(kOrigin, 7, {20, tree.root(20), note(20)}));
  EXPECT_FALSE(store.advance(kOrigin, 7, {12, tree.root(12), note(12)}));
  EXPECT_FALSE(store.advance(kOrigin, 20, {20, tree.root(19), note(20)}));
  EXPECT_EQ(store.log(kOrigin)->latest->size, 20U);
  std::vector<std::thread> threads;
  std::atomic<int> cosigned = 0, conflicts = 0;
  for (int i = 0; i < 4; ++i) {
    threads.emplace_back([&, i] {
      const int status = add(20, 21 + static_cast<std::uint64_t>(i)).status;
      cosigned += status == 200 ? 1 : 0;
      conflicts += status == 409 ? 1 : 0;
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(cosigned, 1);
  EXPECT_EQ(conflicts, 3);
}

// A witness that lost its memory and is told of the log anew would cosign a second history.
TEST_F(Witnessed, ATornDatabaseNeverBeginsAnew) {
  ASSERT_EQ(add(0, 20).status, 200);
  std::ifstream in(folder / "witness.sqlite", std::ios::binary);
  const std::string whole(std::istreambuf_iterator<char>(in), {});
  const auto why = [](const std::filesystem::path& file) -> std::string {
    try {
      Store opened(file);
      return "";
    } catch (const Error& error) {
      return error.what();
    }
  };
  for (std::size_t length = 0; length < whole.size(); length += 512) {
    const std::filesystem::path torn = folder / ("torn" + std::to_string(length));
    std::ofstream(torn, std::ios::binary) << whole.substr(0, length);
    EXPECT_THAT(why(torn), HasSubstr("make a new one with 'kiroku witness init'")) << length;
    EXPECT_EQ(std::filesystem::file_size(torn), length) << "it stays as it is";
  }
  EXPECT_THAT(why(folder / "absent"), HasSubstr("No such file"));
  EXPECT_FALSE(std::filesystem::exists(folder / "absent"));
  EXPECT_EQ(why(folder / "witness.sqlite"), "");
}

// Whoever saw a checkpoint can ask for it again without end.
TEST_F(Witnessed, WhatWasCosignedJustNowIsNotSignedAndStoredAgain) {
  const std::string first = add(0, 20).body;
  time.move(std::chrono::seconds(59));
  EXPECT_EQ(add(20, 20).body, first);
  time.move(std::chrono::seconds(1));
  const Answer later = add(20, 20);
  EXPECT_EQ(later.status, 200);
  EXPECT_NE(later.body, first);
  EXPECT_THAT(store.log(kOrigin)->latest->note, HasSubstr(later.body));
  // Another text of the same size and root is signed for itself.
  const std::string text = crypto::Checkpoint{kOrigin, 20, tree.root(20)}.to_text() + "more\n";
  const Answer extended = witness.add_checkpoint("old 20\n\n" + crypto::sign_note(text, "or-1", log_key));
  EXPECT_EQ(extended.status, 200);
  EXPECT_NE(extended.body, later.body);
}

TEST_F(Witnessed, IsAskedOverHttp) {
  const WitnessServer server(witness, "127.0.0.1:0");
  const AskWitness ask = ask_over_http();
  const std::string url = server.url() + "add-checkpoint";
  const WitnessReply reply = ask(url, submission(0, 7).to_text());
  EXPECT_EQ(reply.status, 200);
  EXPECT_THAT(reply.body, StartsWith("\u2014 w.example/1 "));
  EXPECT_EQ(ask(url, submission(0, 7).to_text()).status, 409);
  EXPECT_EQ(ask(server.url() + "nothing", "").status, 404);
  EXPECT_EQ(ask(server.url(), "").status, 405);
  EXPECT_THROW(ask("http://127.0.0.1:1/", ""), Error);
  EXPECT_THROW(ask("file:///etc/passwd", ""), Error);
}

// --- a log asks
// ----------------------------------------------------------------------------------------------

class Asking : public Witnessed {
 protected:
  explicit Asking(crypto::CosignatureAlgorithm algorithm = crypto::CosignatureAlgorithm::kEd25519)
      : Witnessed(40, algorithm) {}
  [[nodiscard]] LogToShow log(std::uint64_t size) const {
    return {tree, note(size), {kOrigin, size, tree.root(size)}};
  }
  [[nodiscard]] crypto::WitnessPolicy policy(const std::string& url = "http://w/") const {
    return crypto::WitnessPolicy::parse("witness A " + witness.key().to_string() + " " + url + "\nquorum A\n",
                                        "policy.txt");
  }
  AskWitness direct() {
    return [this](const std::string& url, const std::string& body) -> WitnessReply {
      asked.push_back(url);
      const Answer answer = witness.add_checkpoint(body);
      return {answer.status, answer.body};
    };
  }
  std::vector<std::string> asked;
};

TEST_F(Asking, GoesOnFromWhatTheWitnessKnows) {
  for (const std::uint64_t size : {7U, 20U, 20U, 40U}) {
    const auto outcomes = cosign_log(log(size), policy(), direct());
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].why, "");
    EXPECT_TRUE(crypto::judge_witnesses(policy(), cosigned_note(log(size), outcomes), 1'785'920'400).quorum);
  }
  EXPECT_EQ(asked[0], "http://w/add-checkpoint");
  EXPECT_EQ(asked.size(), 1U + 2 + 2 + 2) << "a witness that knows the log says so first";
}

class AskingByMlDsa : public Asking {
 protected:
  AskingByMlDsa() : Asking(crypto::CosignatureAlgorithm::kMlDsa44) {}
};

TEST_F(AskingByMlDsa, IsCosignedAsByEd25519) {
  for (const std::uint64_t size : {7U, 20U, 20U, 40U}) {
    const auto outcomes = cosign_log(log(size), policy(), direct());
    ASSERT_EQ(outcomes.size(), 1U);
    EXPECT_EQ(outcomes[0].why, "");
    EXPECT_TRUE(crypto::judge_witnesses(policy(), cosigned_note(log(size), outcomes), 1'785'920'400).quorum);
  }
  // Asked again within a minute, it gives the line that it gave, though signing would draw fresh bytes.
  EXPECT_EQ(add(40, 40).body, add(40, 40).body);
  time.move(std::chrono::minutes(2));
  const std::string first = add(40, 40).body;
  EXPECT_NE(first, "");
  time.move(std::chrono::minutes(2));
  EXPECT_NE(add(40, 40).body, first);
}

TEST_F(AskingByMlDsa, ALogWhoseNameCannotBeStatedIsRefused) {
  const std::string origin(256, 'o');
  store.add_key(origin, {"or-1", log_key.public_key()});
  Submission made = submission(0, 7);
  made.note = note(7, origin);
  const Answer answer = witness.add_checkpoint(made.to_text());
  EXPECT_EQ(answer.status, 400);
  EXPECT_THAT(answer.body, HasSubstr("more than 255 bytes"));
}

TEST_F(Asking, TellsWhyThereIsNoCosignature) {
  const auto why = [&](const LogToShow& shown, const AskWitness& ask) {
    const auto outcomes = cosign_log(shown, policy(), ask);
    EXPECT_EQ(outcomes.at(0).line, "");
    EXPECT_EQ(cosigned_note(shown, outcomes), shown.note);
    return outcomes.at(0).why;
  };
  ASSERT_EQ(add(0, 40).status, 200);
  EXPECT_THAT(why(log(20), direct()), HasSubstr("knows this log with 40 entries, and here are 20"));
  const auto answers = [](long status, std::string body) -> AskWitness {
    return [status, body = std::move(body)](const std::string&, const std::string&) -> WitnessReply {
      return {status, body};
    };
  };
  EXPECT_THAT(why(log(40), answers(409, "many\n")), HasSubstr("409 without a size"));
  EXPECT_THAT(why(log(40), answers(409, "7\n")), HasSubstr("another size each time"));
  EXPECT_THAT(why(log(40), answers(503, "busy\x1b[2J\n")), StartsWith("answered 503: busy"));
  EXPECT_THAT(why(log(40), answers(503, "busy\x1b[2J\n")), testing::Not(HasSubstr("\x1b")));
  EXPECT_THAT(why(log(40), answers(200, "\u2014 w.example/1 AAAAAAAA\n")), HasSubstr("not its cosignature"));
  EXPECT_THAT(why(log(40), answers(200, "")), HasSubstr("not its cosignature"));
  EXPECT_THAT(
      why(log(40), [](const std::string&, const std::string&) -> WitnessReply { throw Error("is away"); }),
      HasSubstr("is away"));
}

// A blank line in the answer would end the note's text elsewhere: then the line signs another text.
TEST_F(Asking, TakesNoCosignatureOnAnotherText) {
  const AskWitness lying = [this](const std::string&, const std::string&) -> WitnessReply {
    const std::string text =
        crypto::parse_note(note(7) + "\n" + crypto::signature_line("x", 1, Bytes(72))).text;
    return {200, "\n" + key.cosign(text, "w.example/1", 1'785'920'400)};
  };
  const auto outcomes = cosign_log(log(7), policy(), lying);
  EXPECT_EQ(outcomes.at(0).line, "");
  EXPECT_THAT(outcomes.at(0).why, HasSubstr("not its cosignature"));
}

TEST_F(Asking, TakesNoLineOfAnybodyElse) {
  const AskWitness talkative = [this](const std::string&, const std::string& body) -> WitnessReply {
    return {200, witness.add_checkpoint(body).body + crypto::signature_line("somebody", 7, Bytes(72))};
  };
  const auto outcomes = cosign_log(log(7), policy(), talkative);
  EXPECT_THAT(cosigned_note(log(7), outcomes), testing::Not(HasSubstr("somebody")));
  EXPECT_TRUE(crypto::judge_witnesses(policy(), cosigned_note(log(7), outcomes), 1'785'920'400).quorum);
}

// --- what another implementation's tests say
// ------------------------------------------------------------------

// The exchange of FiloSottile/torchwood, cmd/litewitness/testdata/litewitness.txt (ISC), against a sigsum
// log. It answers an unknown log with 403; C2SP's document of today says 404, and so does this witness.
constexpr const char* kSigsumOrigin =
    "sigsum.org/v1/tree/4d6d8825a6bb689d459628312889dfbb0bcd41b5211d9e1ce768b0ff0309e562";
constexpr const char* kSigsumKey = "ffdc2d4d98e4124d3feaf788c0c2f9abfd796083d1f0495437f302ec79cf100f";

TEST_F(Witnessed, AnswersTorchwoodsExchangeAsItsTestsExpect) {
  crypto::Ed25519PublicKey sigsum{};
  std::ranges::copy(*crypto::from_hex(kSigsumKey), sigsum.begin());
  store.add_key(kSigsumOrigin, {kSigsumOrigin, sigsum});
  const auto ask = [&](const std::string& old_and_proof, const std::string& size_and_root,
                       const std::string& signature, const std::string& origin = kSigsumOrigin) {
    return witness.add_checkpoint("old " + old_and_proof + "\n\n" + origin + "\n" + size_and_root +
                                  "\n\n\u2014 " + origin + " " + signature + "\n");
  };
  const std::string leaf1 = "KgEAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
                    leaf2 = "KgIAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
                    leaf3 = "KgMAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
                    leaf4 = "KgQAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=";
  const std::string three = "3\nRcCI1Nk56ZcSmIEfIn0SleqtV7uvrlXNccFx595Iwl0=",
                    five = "5\nQrtXrQZCCvpIgsSmOsah7HdICzMLLyDfxToMql9WTjY=";
  const std::string
      of_three =
          "UgIom2VbtIcdFbwFAy1n7s6IkAxIY6J/GQOTuZF2ORV39d75cbAj2aQYwyJre36kezNobZs4SUUdrcawfAB8WVrx6go=",
      of_five =
          "UgIomw/EOJmWi0i1FQsOj+etB7F8IccFam/jgd6wzRns4QPVmyEZtdvl1U2KEmLOZ/ASRcWJi0tW90dJWAShei7sDww=";
  const Answer first =
      ask("0", "1\nKgAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAA=",
          "UgIom7fPZTqpxWWhyjWduBvTvGVqsokMbqTArsQilegKoFBJQjUFAmQ0+YeSPM3wfUQMFSzVnnNuWRTYrajXpNUbIQY=");
  EXPECT_EQ(first.status, 200) << first.body;
  EXPECT_THAT(first.body, StartsWith("\u2014 w.example/1 "));
  const std::string proof = "1\n" + leaf1 + "\n" + leaf2;
  // Its wrong signature leaves bits over in its base64, which is no form here; another one has the form.
  EXPECT_EQ(
      ask(proof, three,
          "UgIom2VbtIcdFbwFAy1n7s6IkAxIY6J/GQOTuZF2ORV39d75cbAj2aQYwyJre36kezNobZs4SUUdrcawfAB8WVrx6gx=")
          .status,
      400);
  EXPECT_EQ(ask(proof, three, of_five).status, 403);
  EXPECT_EQ(ask(proof, three, of_three,
                "sigsum.org/v1/tree/4d6d8825a6bb689d459628312889dfbb0bcd41b5211d9e1ce768b0ff0309e563")
                .status,
            404);
  EXPECT_EQ(ask("1", three, of_three).status, 422);
  EXPECT_EQ(ask("1\n" + leaf1 + "\nKgIAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAAABA=", three, of_three).status,
            422);
  EXPECT_EQ(ask(proof, three, of_three).status, 200);
  const Answer conflict =
      ask("1\n" + leaf1 + "\n+fUDV+k970B4I3uKrqJM4aP1lloPZP8mvr2Z4wRw2LI=\n" + leaf4, five, of_five);
  EXPECT_EQ(conflict.status, 409);
  EXPECT_EQ(conflict.body, "3\n");
  EXPECT_EQ(ask("3\n" + leaf2 + "\n" + leaf3 + "\nwgiIFdZfYNv6WU1OllBKsWnLYIS/DBMqt8Uh/S4OukE=\n" + leaf4,
                five, of_five)
                .status,
            200);
  const Answer last = ask("0", five, of_five);
  EXPECT_EQ(last.status, 409);
  EXPECT_EQ(last.body, "5\n");
}

TEST_F(Witnessed, CosignsGosChecksumDatabase) {
  // The same repository, sumdb.txt: the log's name is not its key's.
  const std::string origin = "go.sum database tree";
  store.add_key(origin, crypto::VerifierKey::parse(
                            "sum.golang.org+033de0ae+Ac4zctda0e5eza+HJyk9SxEdh+s3Ux18htTTAD8OuAn8"));
  const Answer answer = witness.add_checkpoint(
      "old 0\n\ngo.sum database tree\n35225469\nvt5T6GaLCXvyHFl9VUvvItR43XZxfLgftEcTyO3eJCQ=\n\n\u2014 "
      "sum.golang.org "
      "Az3grpukl5AXaVfYkLiDGORx/DN2nlcS5kZHR5uYOBV2KA2HgXpD+gu9HHONebHLAyaKbbTM75QTtPydhKCExixSfwQ=\n");
  EXPECT_EQ(answer.status, 200) << answer.body;
  EXPECT_EQ(store.log(origin)->latest->size, 35225469U);
}

}  // namespace
}  // namespace kiroku::witness
