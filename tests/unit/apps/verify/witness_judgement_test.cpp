#include "apps/verify/witness_judgement.h"

#include <filesystem>
#include <fstream>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "archive/format/case_layout.h"
#include "archive/format/log_entry.h"
#include "crypto/cosignature.h"
#include "crypto/merkle_tree.h"
#include "crypto/signing_key.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::apps {
namespace {

using testing::HasSubstr;
using testing::Not;

/// A log of three entries, and a witness that cosigns whatever it is shown.
class JudgedWitnesses : public testing::Test {
 protected:
  JudgedWitnesses() {
    std::ofstream ledger(folder / "ledger.jsonl", std::ios::binary);
    for (std::uint64_t i = 0; i < 3; ++i) {
      const UtcTime utc = *parse_utc("2026-08-05T09:15:02.000000Z") + std::chrono::hours(i);
      const archive::LogEntryBody body =
          i == 0 ? archive::LogEntryBody(archive::BootEntry{"b", device.to_string()})
                 : archive::LogEntryBody(archive::ShutdownEntry{});
      const std::string line = archive::to_line(archive::LogEntry{i, {utc, 0}, body});
      ledger << line << '\n';
      tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    }
  }
  [[nodiscard]] archive::OutsideNote cosigned(std::uint64_t size) const {
    return cosigned(size, tree.root(size));
  }
  [[nodiscard]] archive::OutsideNote cosigned(std::uint64_t size, const crypto::Sha256Digest& root) const {
    const std::string text = crypto::Checkpoint{archive::log_origin("or3"), size, root}.to_text();
    return {"kept.note", crypto::sign_note(text, "or3", key) + crypto::cosign(text, "w", witness_key, 1)};
  }
  [[nodiscard]] WitnessJudgement judge(const std::vector<archive::OutsideNote>& notes,
                                       const std::string& quorum = "a") const {
    const crypto::CosignerKey cosigner("w", witness_key.public_key());
    const auto policy = crypto::WitnessPolicy::parse(
        "witness a " + cosigner.to_string() + "\nquorum " + quorum + "\n", "policy.txt");
    return judge_log_witnesses(folder.path(), device, policy, notes);
  }

  const test::TemporaryFolder folder;
  const crypto::SigningKey key = crypto::SigningKey::generate(), witness_key = crypto::SigningKey::generate();
  const crypto::VerifierKey device{"or3", key.public_key()};
  crypto::MerkleTree tree;
};

// Every history goes on from nothing: one such note would do for all logs of the device, for ever.
TEST_F(JudgedWitnesses, ACosignatureOnNothingSaysNothing) {
  const WitnessJudgement judged = judge({cosigned(0)});
  EXPECT_FALSE(judged.witnessed.quorum);
  EXPECT_EQ(judged.note, "");
  EXPECT_THAT(judged.text(), HasSubstr("it is of a log without entries"));
  EXPECT_TRUE(judge({cosigned(0), cosigned(1)}).witnessed.quorum);
}

TEST_F(JudgedWitnesses, TellsWhatNobodyWitnessedAndSinceWhen) {
  const WitnessJudgement first = judge({cosigned(1)});
  EXPECT_THAT(first.text(), HasSubstr("the first 1 of 3 entries is witnessed as the policy asks"));
  EXPECT_THAT(first.text(), HasSubstr("Of the 2 behind them only the device speaks"));
  EXPECT_EQ(first.json()["unwitnessed_since"], "2026-08-05T10:15:02.000000Z");
  EXPECT_EQ(judge({cosigned(2)}).json()["unwitnessed_since"], "2026-08-05T11:15:02.000000Z");
  const WitnessJudgement whole = judge({cosigned(1), cosigned(3)});
  EXPECT_THAT(whole.text(), HasSubstr("the first 3 of 3 entries are witnessed"));
  EXPECT_THAT(whole.text(), Not(HasSubstr("only the device speaks")));
  EXPECT_TRUE(whole.json()["unwitnessed_since"].is_null());
}

TEST_F(JudgedWitnesses, SaysWhyANoteDoesNotFit) {
  EXPECT_THAT(judge({cosigned(3, tree.root(2))}).text(),
              HasSubstr("it was not signed of the entries that this log begins with"));
  EXPECT_THAT(judge({cosigned(9, tree.root(2))}).text(),
              HasSubstr("it is of 9 entries, and here are 3. Entries were taken away"));
}

// Whoever holds the device's key can cosign as well as sign.
TEST_F(JudgedWitnesses, TheDeviceIsNoWitnessOfItsOwnLog) {
  const std::string text = crypto::Checkpoint{archive::log_origin("or3"), 3, tree.root(3)}.to_text();
  const archive::OutsideNote note{
      "kept.note", crypto::sign_note(text, "or3", key) + crypto::cosign(text, "notary", key, 1)};
  const auto policy = crypto::WitnessPolicy::parse(
      "witness a " + crypto::CosignerKey("notary", key.public_key()).to_string() + "\nquorum a\n",
      "policy.txt");
  const WitnessJudgement judged = judge_log_witnesses(folder.path(), device, policy, {note});
  EXPECT_FALSE(judged.witnessed.quorum);
  EXPECT_THAT(judged.text(), HasSubstr("names the device's own key as a witness"));
}

TEST_F(JudgedWitnesses, APolicyThatAsksForNobodyIsSaid) {
  const WitnessJudgement judged = judge({cosigned(3)}, "none");
  EXPECT_TRUE(judged.witnessed.quorum);
  EXPECT_THAT(judged.text(), HasSubstr("The policy asks for no witness"));
  EXPECT_THAT(judged.text(), Not(HasSubstr("witnessed as the policy asks")));
  EXPECT_TRUE(judged.json()["asks_for_none"]);
}

}  // namespace
}  // namespace kiroku::apps
