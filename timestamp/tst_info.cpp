#include <algorithm>
#include <string_view>

#include "crypto/encoding.h"
#include "timestamp/token_parts.h"

namespace kiroku::timestamp {
namespace {

constexpr std::int64_t kNanosecondsPerSecond = 1'000'000'000;
/// An accuracy beyond this states nothing; it also keeps nanoseconds within 64 bits.
constexpr std::int64_t kMostAccuracySeconds = 1'000'000'000;

/// GeneralizedTime as RFC 3161 section 2.4.2 restricts it: YYYYMMDDhhmmss[.s…]Z, the fraction without
/// trailing zeros. Digits beyond microseconds are cut off.
std::optional<UtcTime> parse_gen_time(std::string_view text) {
  constexpr std::size_t kSecondsEnd = 14;
  if (text.size() <= kSecondsEnd || text.back() != 'Z') return {};
  const std::string_view whole = text.substr(0, kSecondsEnd);
  std::string_view fraction = text.substr(kSecondsEnd, text.size() - kSecondsEnd - 1);
  const auto only_digits = [](std::string_view digits) {
    return std::all_of(digits.begin(), digits.end(), [](char c) { return c >= '0' && c <= '9'; });
  };
  if (!only_digits(whole)) return {};
  std::string rfc3339;
  rfc3339.append(whole.substr(0, 4)).append("-").append(whole.substr(4, 2)).append("-");
  rfc3339.append(whole.substr(6, 2)).append("T").append(whole.substr(8, 2)).append(":");
  rfc3339.append(whole.substr(10, 2)).append(":").append(whole.substr(12, 2));
  if (!fraction.empty()) {
    if (fraction[0] != '.' || fraction.size() < 2 || fraction.back() == '0' ||
        !only_digits(fraction.substr(1))) {
      return {};
    }
    rfc3339.append(fraction.substr(0, 7));
  }
  return parse_utc(rfc3339.append("Z"));
}

/// A part of an accuracy: 0 if absent, nothing if outside [least, most].
std::optional<std::int64_t> accuracy_part(const ASN1_INTEGER* number, std::int64_t least, std::int64_t most) {
  if (number == nullptr) return 0;
  std::int64_t value = 0;
  const bool read = ASN1_INTEGER_get_int64(&value, number) == 1;
  forget_openssl_errors();
  if (!read || value < least || value > most) return {};
  return value;
}

std::optional<std::int64_t> accuracy_in_nanoseconds(const TS_ACCURACY* accuracy) {
  if (accuracy == nullptr) return 0;
  const auto seconds = accuracy_part(TS_ACCURACY_get_seconds(accuracy), 0, kMostAccuracySeconds);
  const auto millis = accuracy_part(TS_ACCURACY_get_millis(accuracy), 1, 999);
  const auto micros = accuracy_part(TS_ACCURACY_get_micros(accuracy), 1, 999);
  if (!seconds || !millis || !micros) return {};
  return *seconds * kNanosecondsPerSecond + *millis * 1'000'000 + *micros * 1'000;
}

/// Hexadecimal without leading zeros, a minus sign in front of the (unwise, but seen) negative ones.
std::string serial_text(const ASN1_INTEGER* serial) {
  const std::string digits = crypto::to_hex(view_of(serial));
  const std::size_t first = digits.find_first_not_of('0');
  const bool negative = ASN1_STRING_type(serial) == V_ASN1_NEG_INTEGER;
  if (first == std::string::npos) return "0";
  return (negative ? "-" : "") + digits.substr(first);
}

const X509_EXTENSION* first_critical(TS_TST_INFO* info) {
  for (int i = 0; i < TS_TST_INFO_get_ext_count(info); ++i) {
    const X509_EXTENSION* extension = TS_TST_INFO_get_ext(info, i);
    if (X509_EXTENSION_get_critical(extension) != 0) return extension;
  }
  return nullptr;
}

}  // namespace

std::optional<TokenInfo> parse_tst_info(ByteView der, std::string& explanation) {
  const auto info = decode_with<TsInfo, d2i_TS_TST_INFO>(der);
  if (!info) {
    explanation = "the TSTInfo is malformed";
    return {};
  }
  if (const Bytes again = encode_with<i2d_TS_TST_INFO>(info.get());
      !std::equal(again.begin(), again.end(), der.begin(), der.end())) {
    explanation = "the TSTInfo is not in DER";
    return {};
  }
  if (TS_TST_INFO_get_version(info.get()) != 1) {
    explanation = "the TSTInfo has version " + std::to_string(TS_TST_INFO_get_version(info.get())) +
                  ", where RFC 3161 knows only version 1";
    return {};
  }
  TokenInfo out;
  out.policy = dotted(TS_TST_INFO_get_policy_id(info.get()));

  TS_MSG_IMPRINT* imprint = TS_TST_INFO_get_msg_imprint(info.get());
  const X509_ALGOR* identifier = TS_MSG_IMPRINT_get_algo(imprint);
  out.algorithm = hash_algorithm_of(identifier);
  if (out.algorithm) {
    out.algorithm_name = crypto::hash_name(*out.algorithm);
  } else {
    const ASN1_OBJECT* object = nullptr;
    X509_ALGOR_get0(&object, nullptr, nullptr, identifier);
    out.algorithm_name = name_of(object);
  }
  out.imprint = to_bytes(view_of(TS_MSG_IMPRINT_get_msg(imprint)));
  if (out.algorithm && out.imprint.size() != crypto::hash_size(*out.algorithm)) {
    explanation = "the TSTInfo's imprint has " + std::to_string(out.imprint.size()) + " bytes, a " +
                  out.algorithm_name + " hash has " + std::to_string(crypto::hash_size(*out.algorithm));
    return {};
  }

  out.serial = serial_text(TS_TST_INFO_get_serial(info.get()));
  const ByteView time_text = view_of(TS_TST_INFO_get_time(info.get()));
  const auto gen_time = parse_gen_time(text_of(time_text));
  if (!gen_time) {
    explanation = "the TSTInfo's genTime '" + printable(time_text) + "' is no UTC time as RFC 3161 writes it";
    return {};
  }
  out.gen_time = *gen_time;
  const auto accuracy = accuracy_in_nanoseconds(TS_TST_INFO_get_accuracy(info.get()));
  if (!accuracy) {
    explanation = "the TSTInfo's accuracy is out of range";
    return {};
  }
  out.accuracy_ns = *accuracy;
  out.ordering = TS_TST_INFO_get_ordering(info.get()) != 0;
  if (const ASN1_INTEGER* nonce = TS_TST_INFO_get_nonce(info.get())) out.nonce = integer_octets(nonce);
  if (const X509_EXTENSION* extension = first_critical(info.get())) {
    explanation = "the TSTInfo has the critical extension " +
                  dotted(X509_EXTENSION_get_object(const_cast<X509_EXTENSION*>(extension))) +
                  ", which is not known here";
    return {};
  }
  return out;
}

}  // namespace kiroku::timestamp
