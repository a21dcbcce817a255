#include "archive/format/boot_quote.h"

#include <algorithm>
#include <array>
#include <charconv>

#include "crypto/encoding.h"

namespace kiroku::archive {

namespace {

std::string base64(ByteView bytes) { return crypto::to_base64(bytes, crypto::Base64Padding::kPadded); }

/// What is measured where: TCG PC Client Platform Firmware Profile; GRUB's and shim's own documents.
constexpr std::array<std::string_view, 16> kMeasured{"firmware",
                                                     "firmware settings",
                                                     "option ROMs",
                                                     "option ROM settings",
                                                     "boot loader",
                                                     "boot loader settings, partition table",
                                                     "maker's own",
                                                     "Secure Boot keys",
                                                     "boot commands",
                                                     "kernel and initial RAM disk",
                                                     "",
                                                     "",
                                                     "",
                                                     "",
                                                     "machine owner keys",
                                                     ""};
constexpr unsigned kMeasuredByFirmware = 8;

}  // namespace

crypto::Sha256Digest qualifying_data(const QuotePlace& place) {
  const std::string text = "kiroku/boot-quote\n" + place.device + "\n" + std::to_string(place.entry) + "\n" +
                           crypto::to_hex(place.root) + "\n" + place.boot_id + "\n";
  return crypto::sha256(bytes_of(text));
}

StatedQuote to_stated(const crypto::BootAttester::Quote& quote) {
  StatedQuote stated{base64(quote.attest), base64(quote.signature), {}};
  for (const crypto::PcrValue& each : quote.pcrs) {
    stated.pcrs.push_back(std::to_string(each.index) + ":" + crypto::to_hex(each.value));
  }
  return stated;
}

std::optional<crypto::BootAttester::Quote> from_stated(const StatedQuote& stated) {
  const auto attest = crypto::from_base64(stated.attest, crypto::Base64Padding::kPadded);
  const auto signature = crypto::from_base64(stated.signature, crypto::Base64Padding::kPadded);
  if (!attest || !signature) {
    return std::nullopt;
  }
  crypto::BootAttester::Quote quote{*attest, *signature, {}};
  for (const std::string& each : stated.pcrs) {
    crypto::PcrValue read;
    const std::size_t colon = each.find(':');
    if (colon == std::string::npos) {
      return std::nullopt;
    }
    std::from_chars(each.data(), each.data() + colon, read.index);
    const auto value = crypto::from_hex(std::string_view(each).substr(colon + 1));
    const bool follows = quote.pcrs.empty() || quote.pcrs.back().index < read.index;
    if (!value || value->size() != read.value.size() || !follows) {
      return std::nullopt;
    }
    std::copy(value->begin(), value->end(), read.value.begin());
    quote.pcrs.push_back(read);
  }
  return quote;
}

std::string unmeasured_registers(const std::vector<crypto::PcrValue>& pcrs) {
  std::string names;
  for (unsigned index = 0; index < kMeasuredByFirmware; ++index) {
    const auto found = std::find_if(pcrs.begin(), pcrs.end(),
                                    [index](const crypto::PcrValue& each) { return each.index == index; });
    if (found == pcrs.end() || found->value == crypto::Sha256Digest{}) {
      names += (names.empty() ? "" : ", ") + std::to_string(index);
    }
  }
  return names;
}

std::string pcr_name(unsigned index) {
  const std::string_view what = index < kMeasured.size() ? kMeasured.at(index) : std::string_view();
  return "register " + std::to_string(index) + (what.empty() ? "" : " (" + std::string(what) + ")");
}

}  // namespace kiroku::archive
