#include "recorder/procedure/repeated_messages.h"

#include <gtest/gtest.h>

#include "base/error.h"

namespace kiroku::recorder {
namespace {

bool is_repeated(RepeatedMessages& messages, const std::string& sender, const std::string& sent,
                 const std::string& id, const std::string& patient) {
  const std::string text =
      "MSH|^~\\&|" + sender + "||||" + sent + "||ADT^A01|" + id + "|P|2.5\rPID|1||" + patient + "\r";
  const Hl7Parse parsed = parse_hl7_message(text);
  return messages.is_repeated(*parsed.message, text);
}

TEST(RepeatedMessages, AreKnownByTheirSenderAndControlId) {
  RepeatedMessages messages;
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", "1", "A"));
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", "2", "B"));
  EXPECT_TRUE(is_repeated(messages, "HIS", "20260805080000", "1", "A"));
  EXPECT_TRUE(is_repeated(messages, "HIS", "20260805110000", "1", "A")) << "sent again with a new time";
  EXPECT_FALSE(is_repeated(messages, "LAB", "20260805080000", "1", "A"));
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", "1", "C")) << "it counts anew";
}

TEST(RepeatedMessages, AnIdentifierThatIsAlwaysTheSameTellsNothing) {
  RepeatedMessages messages;
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", "1", "A"));
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805090000", "1", "A"));
  EXPECT_TRUE(is_repeated(messages, "HIS", "20260805090000", "1", "A")) << "every byte, its time, too";
  EXPECT_FALSE(is_repeated(messages, "HIS", "", "1", "A"));
  EXPECT_FALSE(is_repeated(messages, "HIS", "", "1", "A")) << "no time";
}

TEST(RepeatedMessages, AreKnownAfterAStart) {
  RepeatedMessages messages;
  is_repeated(messages, "HIS", "20260805080000", "1", "A");
  is_repeated(messages, "HIS", "20260805080000", "2", "B");
  is_repeated(messages, "LAB", "20260805080000", "1", "A");
  is_repeated(messages, "LAB", "20260805080000", "1", "B");
  const Bytes bytes = messages.exported();
  RepeatedMessages later = RepeatedMessages::imported(bytes);
  EXPECT_EQ(later.exported(), bytes);
  EXPECT_TRUE(is_repeated(later, "HIS", "20260805110000", "1", "A"));
  EXPECT_FALSE(is_repeated(later, "LAB", "20260805110000", "1", "B")) << "it counts anew";
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_THROW(RepeatedMessages::imported(ByteView(bytes).first(size)), Error) << size;
}

TEST(RepeatedMessages, ForgetWhatIsLongAgo) {
  RepeatedMessages messages;
  for (std::size_t i = 0; i <= RepeatedMessages::kRemembered; ++i)
    EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", std::to_string(i), "A"));
  EXPECT_TRUE(is_repeated(messages, "HIS", "20260805080000", "1", "A"));
  EXPECT_FALSE(is_repeated(messages, "HIS", "20260805080000", "0", "A"));
}

}  // namespace
}  // namespace kiroku::recorder
