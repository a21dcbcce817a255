// A TPM's key that is sealed to approved states of the boot, by swtpm.
#include <cstring>
#include <filesystem>
#include <fstream>
#include <optional>
#include <span>
#include <stdexcept>
#include <sys/stat.h>
#include <tss2/tss2_esys.h>
#include <tss2/tss2_rc.h>
#include <tss2/tss2_tctildr.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "recorder/device_key/boot_approval.h"
#include "recorder/device_key/hardware_description.h"
#include "recorder/device_key/tpm_key.h"
#include "tests/support/software_tpm.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::recorder {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::ThrowsMessage;

void write_file(const fs::path& file, std::string_view text) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
}

crypto::PcrValue filled(unsigned index, unsigned char with) {
  crypto::PcrValue value{index, {}};
  value.value.fill(std::byte{with});
  return value;
}

/// A state of a device, without a TPM.
BootState state_of(const crypto::ApprovalKey& approver, unsigned char device = 1) {
  return {"or3",
          {approver.public_key(), {0, 4}, crypto::boot_seal_tag(Bytes(32, std::byte{device}))},
          {filled(0, 1), filled(4, 2)}};
}

TEST(BootStateFile, IsReadAsItIsWritten) {
  const auto approver = crypto::ApprovalKey::generate();
  const BootState state = state_of(approver);
  const BootState read = BootState::parse(state.to_json());
  EXPECT_EQ(read.device, "or3");
  EXPECT_EQ(read.pcrs, state.pcrs);
  EXPECT_EQ(read.seal.tag, state.seal.tag);
  EXPECT_EQ(read.seal.approver, state.seal.approver);
  EXPECT_THAT(read.seal.pcrs, ElementsAre(0U, 4U));
}

TEST(BootApprovalFile, IsReadAsItIsWrittenAndNoOtherIsTaken) {
  const auto approver = crypto::ApprovalKey::generate();
  const BootApproval approval = approve(state_of(approver), approver);
  const std::string text = approval.to_json();
  const BootApproval read = BootApproval::parse(text);
  EXPECT_EQ(read.tag, approval.tag);
  EXPECT_EQ(read.pcrs, approval.pcrs);
  EXPECT_EQ(read.signature, approval.signature);
  const auto refusal = [](const std::string& bad, const char* why) {
    EXPECT_THAT([&] { BootApproval::parse(bad); },
                ThrowsMessage<Error>(AllOf(HasSubstr("no approval of a boot"), HasSubstr(why))))
        << bad;
  };
  for (std::size_t size = 0; size + 1 < text.size(); size += 7) refusal(text.substr(0, size), "cut off");
  const auto with = [&](const std::string& part, const std::string& instead) {
    std::string changed = text;
    changed.replace(changed.find(part), part.size(), instead);
    return changed;
  };
  refusal(state_of(approver).to_json(), "\"kind\"");
  refusal(with("\"0:", "\"4:"), "ascending");
  refusal(with("\"4:", "\"24:"), "0 to 23");
  refusal(with("\"4:", "\"x:"), "0 to 23");
  refusal(with("\"4:02", "\"4:"), "64 hex digits");
  refusal(with("\"4:02", "\"4:0G"), "64 hex digits");
  refusal(with("signature\": \"", "signature\": \"*"), "base64");
  refusal(with("\"signature\"", "\"another\""), "no text \"signature\"");
}

TEST(BootApprovalFile, CountsForItsDeviceItsKeyAndItsRegistersAlone) {
  const auto approver = crypto::ApprovalKey::generate();
  const auto stranger = crypto::ApprovalKey::generate();
  const crypto::BootSeal seal = state_of(approver).seal;
  EXPECT_EQ(why_no_approval(approve(state_of(approver), approver), seal), "");
  EXPECT_THAT(why_no_approval(approve(state_of(stranger), stranger), seal),
              HasSubstr("not by the approval key"));
  EXPECT_THAT(why_no_approval(approve(state_of(approver, 2), approver), seal), HasSubstr("another device"));
  BootApproval changed = approve(state_of(approver), approver);
  changed.pcrs.back().value.front() ^= std::byte{1};
  EXPECT_THAT(why_no_approval(changed, seal), HasSubstr("was changed"));
  changed = approve(state_of(approver), approver);
  changed.pcrs.pop_back();
  EXPECT_THAT(why_no_approval(changed, seal), HasSubstr("of the registers 0, and the key is sealed to 0,4"));
  BootApproval renamed = approve(state_of(approver, 2), approver);
  renamed.tag = seal.tag;
  EXPECT_THAT(why_no_approval(renamed, seal), HasSubstr("was changed")) << "the signature is over the device";
  EXPECT_THAT([&] { approve(state_of(approver), stranger); },
              ThrowsMessage<Error>(HasSubstr("sealed to another approval key")));
}

TEST(BootApprovals, OfAFolderTellWhatDoesNotCount) {
  const test::TemporaryFolder folder;
  const auto approver = crypto::ApprovalKey::generate();
  const crypto::BootSeal seal = state_of(approver).seal;
  EXPECT_TRUE(read_approvals(folder / "none", seal).counting.empty());
  EXPECT_TRUE(read_approvals(folder / "none", seal).problems.empty());
  const BootApproval good = approve(state_of(approver), approver);
  const std::string text = good.to_json();
  write_file(folder / approval_file_name(good), text);
  write_file(folder / "torn.approval", text.substr(0, text.size() / 2));
  write_file(folder / "other.approval", approve(state_of(approver, 2), approver).to_json());
  write_file(folder / "large.approval", std::string(100'000, ' '));
  write_file(folder / "readme.txt", "not looked at");
  ASSERT_EQ(::mkfifo((folder / "pipe.approval").c_str(), 0600), 0);
  const BootApprovals read = read_approvals(folder.path(), seal);
  ASSERT_EQ(read.counting.size(), 1U);
  EXPECT_EQ(read.counting.front().pcrs, good.pcrs);
  EXPECT_THAT(read.problems, ElementsAre(HasSubstr("larger than 64 KiB"), HasSubstr("another device"),
                                         HasSubstr("no regular file"),
                                         AllOf(HasSubstr("torn.approval"), HasSubstr("cut off"))));
  write_file(folder / "file", "");
  EXPECT_EQ(read_approvals(folder / "file", seal).problems.size(), 1U) << "a file where the folder should be";
}

TEST(BootApprovals, TheNearestSaysWhatDiffers) {
  const auto approver = crypto::ApprovalKey::generate();
  const BootState now = state_of(approver);
  EXPECT_FALSE(differing_registers(now.pcrs, {}));
  BootState far = now, near = now;
  far.pcrs = {filled(0, 9), filled(4, 9)};
  near.pcrs = {filled(0, 1), filled(4, 9)};
  const std::vector<BootApproval> approvals{approve(far, approver), approve(near, approver)};
  EXPECT_THAT(differing_registers(now.pcrs, approvals).value(), ElementsAre(4U));
  EXPECT_TRUE(differing_registers(far.pcrs, approvals).value().empty());
}

class BootSealTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!test::SoftwareTpm::is_installed()) GTEST_SKIP() << test::SoftwareTpm::kWhySkipped;
    tpm_.emplace(folder_.path() / "t");
    fs::create_directory(approvals());
    boot(0x11);
    made_ = make_sealed_key(tpm_->tcti(), approver_.public_key(), kUsualSealedPcrs);
  }
  /// The machine starts with this boot loader.
  void boot(unsigned char loader) {
    tpm_->take_away();
    tpm_->start();
    for (const unsigned pcr : {0U, 2U, 7U}) tpm_->measure(pcr, 0x01);
    tpm_->measure(4, loader);
  }
  [[nodiscard]] fs::path approvals() const { return folder_.path() / "approvals"; }
  [[nodiscard]] BootState state() const {
    return {"or3", made_.seal.value(), read_registers(tpm_->tcti(), made_.seal->pcrs)};
  }
  void take_in(const BootApproval& approval) const {
    write_file(approvals() / approval_file_name(approval), approval.to_json());
  }
  /// Why it does not sign; empty where what it signs verifies.
  [[nodiscard]] std::string why_silent() const {
    return crypto::why_silent(*hardware_signer(made_, approvals()));
  }

  test::TemporaryFolder folder_;
  std::optional<test::SoftwareTpm> tpm_;
  crypto::ApprovalKey approver_ = crypto::ApprovalKey::generate();
  HardwareDescription made_;
};

TEST_F(BootSealTest, SignsInAnApprovedStateAndInNoOther) {
  EXPECT_THAT(why_silent(), HasSubstr("none is")) << "before anything is approved";
  take_in(approve(state(), approver_));
  EXPECT_EQ(why_silent(), "");
  boot(0x11);
  EXPECT_EQ(why_silent(), "") << "the same is started again";
  boot(0x22);
  EXPECT_THAT(why_silent(), AllOf(HasSubstr("register 4 differs"), HasSubstr("kiroku boot state")));
  take_in(approve(state(), approver_));
  EXPECT_EQ(why_silent(), "");
  boot(0x11);
  EXPECT_EQ(why_silent(), "") << "an approved state stays approved";
  tpm_->measure(4, 0x33);
  EXPECT_THAT(why_silent(), HasSubstr("register 4 differs")) << "what started measured something more";
  tpm_->measure(4, 0x11);
  EXPECT_THAT(why_silent(), HasSubstr("register 4 differs")) << "and cannot take it back";
}

TEST_F(BootSealTest, StopsWhereSomethingIsMeasuredAndGoesOnAfterApprovalByItself) {
  const auto signer = hardware_signer(made_, approvals());
  take_in(approve(state(), approver_));
  // More often than a TPM has room for keys and sessions.
  for (int i = 0; i < 8; ++i) EXPECT_EQ(crypto::why_silent(*signer), "") << i;
  boot(0x22);
  EXPECT_NE(crypto::why_silent(*signer), "");
  for (int i = 0; i < 8; ++i) EXPECT_THAT(crypto::why_silent(*signer), HasSubstr("register 4 differs")) << i;
  take_in(approve(state(), approver_));
  EXPECT_EQ(crypto::why_silent(*signer), "") << "nothing was started anew";
}

TEST_F(BootSealTest, IsNotMovedByRegistersThatItIsNotSealedTo) {
  take_in(approve(state(), approver_));
  tpm_->measure(10, 0x44);
  tpm_->measure(1, 0x44);
  EXPECT_EQ(why_silent(), "");
}

TEST_F(BootSealTest, AForeignApprovalDoesNotCountAndIsNamed) {
  const auto stranger = crypto::ApprovalKey::generate();
  BootState claimed = state();
  claimed.seal.approver = stranger.public_key();
  take_in(approve(claimed, stranger));
  EXPECT_THAT(why_silent(), AllOf(HasSubstr("none is"), HasSubstr("not by the approval key")));
  take_in(approve(state(), approver_));
  EXPECT_EQ(why_silent(), "");
}

TEST_F(BootSealTest, AnApprovalOfAnotherDeviceWithTheSameApproverDoesNotCount) {
  const HardwareDescription other = make_sealed_key(tpm_->tcti(), approver_.public_key(), kUsualSealedPcrs);
  const BootState theirs{"or4", other.seal.value(), state().pcrs};
  take_in(approve(theirs, approver_));
  EXPECT_THAT(why_silent(), HasSubstr("for the key of another device"));
}

// Whoever writes to the disk changes what the description says, with an approver of their own.
TEST_F(BootSealTest, ADescriptionWithAnotherSealIsOfAnotherKey) {
  const auto stranger = crypto::ApprovalKey::generate();
  HardwareDescription theirs = made_;
  theirs.seal->approver = stranger.public_key();
  take_in(approve({"or3", *theirs.seal, state().pcrs}, stranger));
  EXPECT_THAT(crypto::why_silent(*hardware_signer(theirs, approvals())), HasSubstr("does not fit the key"));
  theirs.seal.reset();
  EXPECT_THAT(crypto::why_silent(*hardware_signer(theirs, approvals())), HasSubstr("does not fit the key"));
  theirs = made_;
  theirs.seal->pcrs = {1};
  EXPECT_THAT(crypto::why_silent(*hardware_signer(theirs, approvals())), HasSubstr("none is"))
      << "other registers are another approval";
}

TEST_F(BootSealTest, AnotherTpmHasAnotherKeyInTheSameState) {
  take_in(approve(state(), approver_));
  test::SoftwareTpm other(folder_.path() / "o");
  for (const unsigned pcr : {0U, 2U, 7U}) other.measure(pcr, 0x01);
  other.measure(4, 0x11);
  HardwareDescription moved = made_;
  moved.address = other.tcti();
  EXPECT_THAT(crypto::why_silent(*hardware_signer(moved, approvals())), HasSubstr("does not fit the key"));
}

TEST_F(BootSealTest, AStateThatIsNotApprovedIsQuotedAllTheSame) {
  take_in(approve(state(), approver_));
  made_.attestation_key = find_attestation_key(made_);
  boot(0x22);
  const auto signer = hardware_signer(made_, approvals());
  EXPECT_NE(crypto::why_silent(*signer), "");
  EXPECT_TRUE(signer->attester()->quote({}).quote);
}

TEST_F(BootSealTest, ATpmWithoutSha256RegistersSaysSo) {
  tpm_->keep_sha256_bank(false);
  tpm_->take_away();
  tpm_->start();
  EXPECT_THAT(why_silent(), HasSubstr("SHA-256 bank is switched off"));
  EXPECT_THAT([&] { read_registers(tpm_->tcti(), {0}); }, ThrowsMessage<Error>(HasSubstr("SHA-256 bank")));
}

TEST_F(BootSealTest, OneThatHangsIsNotWaitedForLong) {
  tpm_->hang();
  EXPECT_THAT([&] { read_registers(tpm_->tcti(), {0}); }, ThrowsMessage<Error>(HasSubstr("did not answer")));
  tpm_->hang(false);
}

TEST_F(BootSealTest, RegistersThatCannotBeSealedToAreRefused) {
  for (const unsigned each : {10U, 11U, 16U, 23U}) {
    EXPECT_THAT(
        [&] {
          make_sealed_key(tpm_->tcti(), approver_.public_key(), {0, each});
        },
        ThrowsMessage<UsageError>(HasSubstr("register " + std::to_string(each))));
  }
}

TEST(SealableRegisters, HoldWhatTheFirmwareStarted) {
  using Registers = std::vector<unsigned>;
  for (const Registers& each : std::vector<Registers>{{8, 9}, {14}, {0}, {0, 2}, {1}, {0, 2, 7, 8, 9, 14}}) {
    EXPECT_THAT([&] { require_sealable(each); },
                ThrowsMessage<UsageError>(AllOf(HasSubstr("without register 4"), HasSubstr("name 4, too"))))
        << crypto::pcr_list(each);
  }
  for (const Registers& each : std::vector<Registers>{{4}, {4, 7}, kUsualSealedPcrs})
    EXPECT_NO_THROW(require_sealable(each)) << crypto::pcr_list(each);
}

TEST_F(BootSealTest, ItsDescriptionHasTheSeal) {
  const std::string text = made_.to_json();
  const auto read = HardwareDescription::parse(text);
  ASSERT_TRUE(read.seal);
  EXPECT_EQ(read.seal->approver, made_.seal->approver);
  EXPECT_EQ(read.seal->pcrs, kUsualSealedPcrs);
  EXPECT_EQ(read.seal->tag, made_.seal->tag);
  const auto refuse = [&](const std::string& part, const std::string& instead, const char* why) {
    std::string changed = text;
    changed.replace(changed.find(part), part.size(), instead);
    EXPECT_THAT([&] { HardwareDescription::parse(changed); }, ThrowsMessage<Error>(HasSubstr(why)))
        << changed;
  };
  refuse("\"kind\": \"tpm\"", "\"kind\": \"pkcs11\"", "sealed_to_boot");
  refuse("\"approval_key\": \"MFkw", "\"approval_key\": \"MFkx", "no key on P-256");
  refuse("\"pcrs\": [", "\"pcrs\": [24,", "0 to 23");
  refuse("\"pcrs\": [", "\"pcrs\": [-1,", "0 to 23");
  refuse("\"pcrs\": [", "\"pcrs\": [9,", "ascending");
  refuse("\"pcrs\"", "\"registers\"", "sealed_to_boot");
}

/// What is asked of the TPM itself, past the program: whoever runs another program asks it so.
class SealedKeyInTheTpm {
 public:
  SealedKeyInTheTpm(const std::string& tcti, const HardwareDescription& of) {
    require(Tss2_TctiLdr_Initialize(tcti.c_str(), &way_));
    require(Esys_Initialize(&tpm_, way_, nullptr));
    TPM2B_PUBLIC wanted{};
    TPMT_PUBLIC& area = wanted.publicArea;
    area.type = TPM2_ALG_ECC;
    area.nameAlg = TPM2_ALG_SHA256;
    area.objectAttributes = TPMA_OBJECT_FIXEDTPM | TPMA_OBJECT_FIXEDPARENT | TPMA_OBJECT_SENSITIVEDATAORIGIN |
                            TPMA_OBJECT_ADMINWITHPOLICY | TPMA_OBJECT_NODA | TPMA_OBJECT_SIGN_ENCRYPT;
    const crypto::Sha256Digest policy = crypto::seal_policy(of.seal.value());
    area.authPolicy.size = static_cast<UINT16>(policy.size());
    std::memcpy(area.authPolicy.buffer, policy.data(), policy.size());
    area.parameters.eccDetail = {
        {TPM2_ALG_NULL, {}, {}}, {TPM2_ALG_ECDSA, {}}, TPM2_ECC_NIST_P256, {TPM2_ALG_NULL, {}}};
    area.parameters.eccDetail.scheme.details.ecdsa.hashAlg = TPM2_ALG_SHA256;
    area.unique.ecc.x.size = static_cast<UINT16>(of.key.size());
    std::memcpy(area.unique.ecc.x.buffer, of.key.data(), of.key.size());
    const TPM2B_SENSITIVE_CREATE no_secret{};
    const TPM2B_DATA nothing{};
    const TPML_PCR_SELECTION no_registers{};
    TPM2B_PUBLIC* made = nullptr;
    require(Esys_CreatePrimary(tpm_, ESYS_TR_RH_OWNER, ESYS_TR_PASSWORD, ESYS_TR_NONE, ESYS_TR_NONE,
                               &no_secret, &wanted, &nothing, &no_registers, &key_, &made, nullptr, nullptr,
                               nullptr));
    const auto bytes = [](const TPM2B_ECC_PARAMETER& of_point) {
      return std::as_bytes(std::span(of_point.buffer, of_point.size));
    };
    public_key =
        crypto::p256_public_key(bytes(made->publicArea.unique.ecc.x), bytes(made->publicArea.unique.ecc.y));
    Esys_Free(made);
  }
  ~SealedKeyInTheTpm() {
    Esys_FlushContext(tpm_, key_);
    Esys_Finalize(&tpm_);
    Tss2_TctiLdr_Finalize(&way_);
  }
  SealedKeyInTheTpm(const SealedKeyInTheTpm&) = delete;
  SealedKeyInTheTpm& operator=(const SealedKeyInTheTpm&) = delete;
  [[nodiscard]] TSS2_RC sign_by(ESYS_TR authorization) const {
    TPM2B_DIGEST digest{};
    digest.size = 32;
    TPMT_SIG_SCHEME scheme{};
    scheme.scheme = TPM2_ALG_ECDSA;
    scheme.details.ecdsa.hashAlg = TPM2_ALG_SHA256;
    TPMT_TK_HASHCHECK no_ticket{};
    no_ticket.tag = TPM2_ST_HASHCHECK;
    no_ticket.hierarchy = TPM2_RH_NULL;
    TPMT_SIGNATURE* made = nullptr;
    const TSS2_RC code =
        Esys_Sign(tpm_, key_, authorization, ESYS_TR_NONE, ESYS_TR_NONE, &digest, &scheme, &no_ticket, &made);
    Esys_Free(made);
    return code;
  }
  /// In a policy session in which the registers alone, or nothing at all, was fulfilled.
  [[nodiscard]] TSS2_RC sign_by_policy(bool registers) const {
    TPMT_SYM_DEF no_encryption{};
    no_encryption.algorithm = TPM2_ALG_NULL;
    ESYS_TR session = ESYS_TR_NONE;
    require(Esys_StartAuthSession(tpm_, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE,
                                  nullptr, TPM2_SE_POLICY, &no_encryption, TPM2_ALG_SHA256, &session));
    if (registers) {
      TPML_PCR_SELECTION selection{};
      selection.count = 1;
      selection.pcrSelections[0] = {TPM2_ALG_SHA256, 3, {0x95, 0x03, 0}};
      const TPM2B_DIGEST as_they_are{};
      require(
          Esys_PolicyPCR(tpm_, session, ESYS_TR_NONE, ESYS_TR_NONE, ESYS_TR_NONE, &as_they_are, &selection));
    }
    const TSS2_RC code = sign_by(session);
    Esys_FlushContext(tpm_, session);
    return code;
  }
  crypto::P256PublicKey public_key;

 private:
  static void require(TSS2_RC code) {
    if (code != TSS2_RC_SUCCESS) throw std::runtime_error(Tss2_RC_Decode(code));
  }
  TSS2_TCTI_CONTEXT* way_ = nullptr;
  ESYS_CONTEXT* tpm_ = nullptr;
  ESYS_TR key_ = ESYS_TR_NONE;
};

TEST_F(BootSealTest, TheTpmItselfRefusesWhoeverAsksWithoutAnApproval) {
  const SealedKeyInTheTpm key(tpm_->tcti(), made_);
  ASSERT_EQ(key.public_key, made_.public_key);
  const auto said = [](TSS2_RC code) { return code & 0xffU; };
  EXPECT_EQ(said(key.sign_by(ESYS_TR_PASSWORD)), TPM2_RC_AUTH_UNAVAILABLE & 0xffU) << "it has no password";
  EXPECT_EQ(said(key.sign_by_policy(false)), TPM2_RC_POLICY_FAIL & 0xffU);
  EXPECT_EQ(said(key.sign_by_policy(true)), TPM2_RC_POLICY_FAIL & 0xffU);
}

}  // namespace
}  // namespace kiroku::recorder
