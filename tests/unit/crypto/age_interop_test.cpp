// Debian's age opens our files, and we open its.
#include <cstdlib>
#include <fstream>

#include <gtest/gtest.h>

#include "crypto/age_file.h"
#include "tests/support/patterned_bytes.h"
#include "tests/support/shared_data.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::crypto {
namespace {

constexpr std::size_t kInteropSizes[] = {0, 1, 65535, 65536, 65537, 1 << 20};

bool have(const std::string& program) {
  return std::system(("command -v " + program + " >/dev/null").c_str()) == 0;
}

class AgeInterop : public testing::Test {
 protected:
  void SetUp() override {
    if (!have("age") || !have("age-keygen"))
      GTEST_SKIP() << "needs the programs age and age-keygen, not there";
  }
  [[nodiscard]] bool run(const std::string& command) const {
    return std::system(("cd '" + folder_.path().string() + "' && { " + command + "; } 2>>log").c_str()) == 0;
  }
  /// Makes an identity with age-keygen and returns its recipient.
  [[nodiscard]] std::string keygen(const std::string& name) const {
    EXPECT_TRUE(run("age-keygen -o " + name + " && age-keygen -y " + name + " >" + name + ".pub"));
    std::string recipient;
    std::ifstream(folder_ / (name + ".pub")) >> recipient;
    return recipient;
  }
  [[nodiscard]] AgeIdentities identities(const std::string& name) const {
    return load_identity_file(folder_ / name,
                              [](const std::string&) { return Secret::copy_of("correct horse"); });
  }
  void write(const std::string& name, ByteView content) const {
    std::ofstream(folder_ / name, std::ios::binary) << text_of(content);
  }
  [[nodiscard]] Bytes read(const std::string& name) const { return test::read_whole(folder_ / name); }

  test::TemporaryFolder folder_;
};

TEST_F(AgeInterop, AgeOpensOurs) {
  const auto first = parse_recipient(keygen("first"));
  const auto second = parse_recipient(keygen("second"));
  for (const std::size_t size : kInteropSizes) {
    const Bytes plaintext = test::patterned_bytes(size);
    for (const auto& recipients : {AgeRecipients{first}, AgeRecipients{second, first}}) {
      write("sealed.age", seal_bytes(plaintext, recipients));
      ASSERT_TRUE(run("age -d -i first -o plain sealed.age")) << size;
      EXPECT_EQ(read("plain"), plaintext);
    }
  }
}

TEST_F(AgeInterop, WeOpenAges) {
  const std::string first = keygen("first");
  const std::string second = keygen("second");
  for (const std::size_t size : kInteropSizes) {
    const Bytes plaintext = test::patterned_bytes(size);
    write("plain", plaintext);
    for (const std::string& recipients : {"-r " + first, "-r " + second + " -r " + first}) {
      ASSERT_TRUE(run("age " + recipients + " -o sealed.age plain")) << size;
      EXPECT_EQ(unseal_bytes(read("sealed.age"), identities("first")), plaintext) << size;
    }
  }
}

TEST_F(AgeInterop, AgreesOnRecipientsOfIdentities) {
  const AgeKeyPair pair = generate_age_key();
  write("ours", bytes_of(pair.identity_text.text()));
  ASSERT_TRUE(run("age-keygen -y ours >ours.pub"));
  EXPECT_EQ(text_of(read("ours.pub")), pair.recipient + "\n");
}

TEST_F(AgeInterop, WeOpenAnIdentityFileThatAgeSealed) {
  if (!have("script")) GTEST_SKIP() << "needs the program script, which gives age the terminal it asks on";
  const std::string recipient = keygen("first");
  // age asks twice, on its terminal, which keeps what was typed ahead.
  ASSERT_TRUE(
      run("printf 'correct horse\\ncorrect horse\\n' | "
          "script -qec 'age -p -o sealed-identity first' /dev/null >terminal"))
      << text_of(read("terminal"));
  const Bytes sealed = seal_bytes(bytes_of("film"), {parse_recipient(recipient)});
  EXPECT_EQ(text_of(unseal_bytes(sealed, identities("sealed-identity"))), "film");
}

TEST_F(AgeInterop, AgeRefusesWhatWeCut) {
  const auto recipient = parse_recipient(keygen("first"));
  const Bytes sealed = seal_bytes(test::patterned_bytes(200000), {recipient});
  write("cut.age", ByteView(sealed).first(150000));
  EXPECT_FALSE(run("age -d -i first cut.age >prefix"));
  // What age emits of it is what a tolerant reader gives.
  const Bytes cut = read("cut.age");
  const auto source = memory_source(cut);
  const AgeFile file = AgeFile::open(*source, identities("first"), Truncation::kTolerate);
  Bytes ours;
  file.read_all([&](ByteView bytes) { append(ours, bytes); });
  EXPECT_EQ(ours, read("prefix"));
  EXPECT_EQ(ours.size(), 2 * kAgeChunkSize);
}

}  // namespace
}  // namespace kiroku::crypto
