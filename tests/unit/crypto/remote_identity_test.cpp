#include "crypto/remote_identity.h"

#include <array>
#include <sys/socket.h>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/age_error.h"
#include "crypto/age_file.h"
#include "crypto/age_hybrid.h"

namespace kiroku::crypto {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

/// Somebody who holds identities, and a socket to them.
class RemoteIdentity : public testing::Test {
 protected:
  void hold(AgeIdentities identities) {
    std::array<int, 2> ends{};
    ASSERT_EQ(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends.data()), 0);
    holder_ = Descriptor(ends[0]);
    asker_ = Descriptor(ends[1]);
    answering_ = std::jthread([this, its = std::move(identities)] {
      answer_for(its, holder_.number());
      ended_ = true;
    });
  }
  ~RemoteIdentity() override {
    if (holder_) ::shutdown(holder_.number(), SHUT_RDWR);
  }

  static Bytes sealed_for(const std::string& recipient, std::string_view text) {
    return seal_bytes(bytes_of(text), {parse_recipient(recipient)});
  }

  Descriptor holder_, asker_;
  std::atomic<bool> ended_{false};
  std::jthread answering_;
};

TEST_F(RemoteIdentity, OpensWhatItsHolderCanOpen) {
  const AgeKeyPair first = generate_age_key(), second = generate_hybrid_age_key();
  hold({parse_identity(first.identity_text.text()), parse_identity(second.identity_text.text())});
  const AgeIdentities remote{remote_identity(std::move(asker_))};
  EXPECT_EQ(text_of(unseal_bytes(sealed_for(first.recipient, "one"), remote)), "one");
  EXPECT_EQ(text_of(unseal_bytes(sealed_for(second.recipient, "two"), remote)), "two");
  EXPECT_EQ(text_of(unseal_bytes(sealed_for(first.recipient, "three"), remote)), "three");
}

TEST_F(RemoteIdentity, DoesNotOpenWhatItsHolderCannot) {
  hold({parse_identity(generate_age_key().identity_text.text())});
  const AgeIdentities remote{remote_identity(std::move(asker_))};
  EXPECT_THROW((void)unseal_bytes(sealed_for(generate_age_key().recipient, "other"), remote), AgeError);
}

TEST_F(RemoteIdentity, SaysWhereItsHolderHasGone) {
  const AgeKeyPair pair = generate_age_key();
  hold({parse_identity(pair.identity_text.text())});
  ::shutdown(holder_.number(), SHUT_RDWR);
  answering_.join();
  const AgeIdentities remote{remote_identity(std::move(asker_))};
  EXPECT_THAT([&] { (void)unseal_bytes(sealed_for(pair.recipient, "late"), remote); },
              ThrowsMessage<Error>(HasSubstr("does not answer any more")));
}

TEST_F(RemoteIdentity, IsNotAnsweredWhereItAsksNoQuestion) {
  hold({parse_identity(generate_age_key().identity_text.text())});
  const std::array<unsigned char, 8> nonsense{0, 0, 0, 4, 'n', 'o', 'n', 'e'};
  ASSERT_EQ(::send(asker_.number(), nonsense.data(), nonsense.size(), 0), 8);
  answering_.join();
  EXPECT_TRUE(ended_);
  const std::array<unsigned char, 4> endless{0xff, 0xff, 0xff, 0xff};
  hold({parse_identity(generate_age_key().identity_text.text())});
  ASSERT_EQ(::send(asker_.number(), endless.data(), endless.size(), 0), 4);
  answering_.join();
  EXPECT_TRUE(ended_) << "no four gigabytes are waited for";
}

}  // namespace
}  // namespace kiroku::crypto
