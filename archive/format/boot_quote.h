// What a quote of the measured boot in the appliance log is bound to, and how its registers are written
// (docs/reference/format.md, "A boot that its TPM quotes"). Pure functions, thread-safe.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "archive/format/log_entry.h"
#include "crypto/hash.h"
#include "crypto/tpm_quote.h"

namespace kiroku::archive {

/// Where in which log a quote stands, and of which boot it is.
struct QuotePlace {
  std::string device;           // the log's, as its entries state it
  std::uint64_t entry = 0;      // number of the entry with the quote
  crypto::Sha256Digest root{};  // over all entries before it
  std::string boot_id;          // of the boot that it is of
};
/// The qualifying data that the TPM is asked with: so a quote fits one place of one log.
crypto::Sha256Digest qualifying_data(const QuotePlace& place);

/// As an entry has it.
StatedQuote to_stated(const crypto::BootAttester::Quote& quote);
/// What an entry has; nothing for texts that are no base64 in its one form, or registers that do not stand in
/// ascending order. `stated` is of an entry that was read.
std::optional<crypto::BootAttester::Quote> from_stated(const StatedQuote& stated);

/// Those of the registers 0 to 7 that are not among these, or are as they are when a TPM gets power, as "0,
/// 7"; empty: none. Every firmware of a machine with a TPM measures something into each of them, if only that
/// it goes on to the boot loader (TCG PC Client Platform Firmware Profile, EV_SEPARATOR): into one that is
/// left empty whoever starts the machine can measure what they like.
std::string unmeasured_registers(const std::vector<crypto::PcrValue>& pcrs);

/// "register 4 (boot loader)".
std::string pcr_name(unsigned index);

}  // namespace kiroku::archive
