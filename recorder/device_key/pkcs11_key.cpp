#include "recorder/device_key/pkcs11_key.h"

#include <array>
#include <fstream>
#include <new>
#include <optional>
#include <vector>

#define P11_KIT_FUTURE_UNSTABLE_API
#include <p11-kit/p11-kit.h>
#include <p11-kit/uri.h>

#include "base/error.h"
#include "crypto/hash.h"
#include "crypto/secret.h"

namespace kiroku::recorder {
namespace {

/// prime256v1 as an OBJECT IDENTIFIER in DER.
constexpr std::array<unsigned char, 10> kCurve{0x06, 0x08, 0x2a, 0x86, 0x48, 0xce, 0x3d, 0x03, 0x01, 0x07};
constexpr std::size_t kCoordinateSize = 32;
/// A point in DER: OCTET STRING of 0x04 and both coordinates.
constexpr std::size_t kPointSize = 3 + 2 * kCoordinateSize;

void check(CK_RV code, const char* what) {
  if (code == CKR_OK) return;
  const char* const words = p11_kit_strerror(code);
  throw Error(std::string("the token cannot ") + what + ": " + (words == nullptr ? "unknown error" : words));
}

/// No PIN must be tried again.
class PinRefused : public Error {
 public:
  using Error::Error;
};

bool is_about_pin(CK_RV code) {
  return code == CKR_PIN_INCORRECT || code == CKR_PIN_INVALID || code == CKR_PIN_LEN_RANGE ||
         code == CKR_PIN_EXPIRED || code == CKR_PIN_LOCKED;
}

struct UriFree {
  void operator()(P11KitUri* uri) const { p11_kit_uri_free(uri); }
};
using Uri = std::unique_ptr<P11KitUri, UriFree>;

Uri parse_uri(const std::string& text) {
  Uri uri(p11_kit_uri_new());
  if (!uri) throw std::bad_alloc();
  constexpr auto kOfToken =
      static_cast<P11KitUriType>(P11_KIT_URI_FOR_TOKEN | P11_KIT_URI_FOR_MODULE_WITH_VERSION);
  const int code = p11_kit_uri_parse(text.c_str(), kOfToken, uri.get());
  if (code != P11_KIT_URI_OK || p11_kit_uri_any_unrecognized(uri.get()) != 0)
    throw UsageError(
        "'" + text + "' is no PKCS#11 URI of a token (RFC 7512): give one such as " +
        "'pkcs11:token=NAME?module-path=/usr/lib/softhsm/libsofthsm2.so&pin-source=file:/etc/pin'");
  // The URI is written to a file that everybody may read, and is told in messages.
  if (p11_kit_uri_get_pin_value(uri.get()) != nullptr)
    throw UsageError("the PKCS#11 URI holds the token's PIN (pin-value): use pin-source=file:FILE");
  if (p11_kit_uri_get_module_path(uri.get()) == nullptr)
    throw UsageError("'" + text + "' does not say which library speaks with the token: add module-path=FILE");
  return uri;
}

std::optional<crypto::Secret> pin_of(P11KitUri* uri) {
  const char* const source = p11_kit_uri_get_pin_source(uri);
  if (source == nullptr) return std::nullopt;
  constexpr std::string_view kFile = "file:";
  std::string_view path = source;
  if (path.starts_with(kFile)) path.remove_prefix(kFile.size());
  std::ifstream file{std::string(path)};
  std::string line;
  if (!std::getline(file, line)) throw Error("cannot read the token's PIN from " + std::string(path));
  std::string_view text = line;
  if (text.ends_with('\r')) text.remove_suffix(1);
  crypto::Secret pin = crypto::Secret::copy_of(text);
  crypto::zeroise(std::as_writable_bytes(std::span(line)));
  return pin;
}

template <typename T>
CK_ATTRIBUTE attribute(CK_ATTRIBUTE_TYPE type, T& value) {
  return {type, &value, sizeof value};
}
CK_ATTRIBUTE attribute_of(CK_ATTRIBUTE_TYPE type, ByteView value) {
  return {type, const_cast<std::byte*>(value.data()), static_cast<CK_ULONG>(value.size())};
}

}  // namespace

struct Pkcs11Key::Connection {
  explicit Connection(const std::string& address) : uri(parse_uri(address)) {
    try {
      open();
    } catch (...) {
      close();
      throw;
    }
  }
  ~Connection() { close(); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  void open() {
    const char* const path = p11_kit_uri_get_module_path(uri.get());
    module = p11_kit_module_load(path, 0);
    if (module == nullptr) {
      const char* const why = p11_kit_message();
      throw Error(std::string("cannot load the PKCS#11 library ") + path + ": " +
                  (why == nullptr ? "unknown error" : why));
    }
    check(p11_kit_module_initialize(module), "be spoken to");
    initialized = true;
    CK_TOKEN_INFO info{};
    check(module->C_OpenSession(slot(info), CKF_SERIAL_SESSION | CKF_RW_SESSION, nullptr, nullptr, &session),
          "open a session");
    has_session = true;
    if (const auto pin = pin_of(uri.get())) {
      if ((info.flags & CKF_USER_PIN_FINAL_TRY) != 0)
        throw PinRefused(
            "the token takes one more PIN before it locks itself, which is not tried here: unlock it with "
            "its "
            "own tool, and start this program anew");
      const CK_RV code = module->C_Login(
          session, CKU_USER, reinterpret_cast<unsigned char*>(const_cast<std::byte*>(pin->bytes().data())),
          pin->size());
      if (is_about_pin(code)) {
        const char* const words = p11_kit_strerror(code);
        throw PinRefused(
            std::string("the token cannot be unlocked by the PIN given, which is not tried again (") +
            (words == nullptr ? "unknown error" : words) +
            "): correct the file of pin-source, and start this program anew");
      }
      if (code != CKR_USER_ALREADY_LOGGED_IN) check(code, "be unlocked");
    }
  }

  CK_SLOT_ID slot(CK_TOKEN_INFO& info) const {
    CK_ULONG count = 0;
    check(module->C_GetSlotList(CK_TRUE, nullptr, &count), "be found");
    std::vector<CK_SLOT_ID> slots(count);
    check(module->C_GetSlotList(CK_TRUE, slots.data(), &count), "be found");
    slots.resize(count);
    for (const CK_SLOT_ID each : slots) {
      if (module->C_GetTokenInfo(each, &info) == CKR_OK &&
          p11_kit_uri_match_token_info(uri.get(), &info) == 1)
        return each;
    }
    throw Error("no token that is plugged in fits the PKCS#11 URI");
  }

  void close() {
    if (has_session) module->C_CloseSession(session);
    if (initialized) p11_kit_module_finalize(module);
    if (module != nullptr) p11_kit_module_release(module);
  }

  CK_OBJECT_HANDLE private_key(ByteView id) const {
    CK_OBJECT_CLASS kind = CKO_PRIVATE_KEY;
    std::array wanted{attribute(CKA_CLASS, kind), attribute_of(CKA_ID, id)};
    check(module->C_FindObjectsInit(session, wanted.data(), wanted.size()), "look for its key");
    CK_OBJECT_HANDLE key = 0;
    CK_ULONG found = 0;
    const CK_RV code = module->C_FindObjects(session, &key, 1, &found);
    module->C_FindObjectsFinal(session);
    check(code, "look for its key");
    if (found == 0) throw Error("the token does not hold the device's key");
    return key;
  }

  Uri uri;
  CK_FUNCTION_LIST* module = nullptr;
  CK_SESSION_HANDLE session = 0;
  bool initialized = false, has_session = false;
};

Pkcs11Key::Pkcs11Key(std::string uri, Bytes id) : uri_(std::move(uri)), id_(std::move(id)) {}
Pkcs11Key::~Pkcs11Key() = default;
Pkcs11Key::Pkcs11Key(Pkcs11Key&&) noexcept = default;

Pkcs11Key::Connection& Pkcs11Key::connection() {
  if (!refused_.empty()) throw Error(refused_);
  try {
    if (!connection_) connection_ = std::make_unique<Connection>(uri_);
  } catch (const PinRefused& error) {
    refused_ = error.what();
    throw;
  }
  return *connection_;
}

crypto::P256PublicKey Pkcs11Key::generate() {
  const Connection& open = connection();
  CK_BBOOL yes = CK_TRUE, no = CK_FALSE;
  std::string label = "kiroku-device";
  const CK_ATTRIBUTE name{CKA_LABEL, label.data(), label.size()};
  std::array its_public{attribute(CKA_TOKEN, yes), attribute(CKA_VERIFY, yes), attribute_of(CKA_ID, id_),
                        name, attribute_of(CKA_EC_PARAMS, std::as_bytes(std::span(kCurve)))};
  std::array its_private{attribute(CKA_TOKEN, yes),
                         attribute(CKA_PRIVATE, yes),
                         attribute(CKA_SENSITIVE, yes),
                         attribute(CKA_EXTRACTABLE, no),
                         attribute(CKA_SIGN, yes),
                         attribute_of(CKA_ID, id_),
                         name};
  CK_MECHANISM mechanism{CKM_EC_KEY_PAIR_GEN, nullptr, 0};
  CK_OBJECT_HANDLE public_half = 0, private_half = 0;
  check(open.module->C_GenerateKeyPair(open.session, &mechanism, its_public.data(), its_public.size(),
                                       its_private.data(), its_private.size(), &public_half, &private_half),
        "make a key");
  // A token that keeps to the standard says of a key that it made so that it never left.
  CK_BBOOL local = CK_FALSE, never_left = CK_FALSE;
  std::array said{attribute(CKA_LOCAL, local), attribute(CKA_NEVER_EXTRACTABLE, never_left)};
  check(open.module->C_GetAttributeValue(open.session, private_half, said.data(), said.size()),
        "say whether its key can be copied");
  if (local != CK_TRUE || never_left != CK_TRUE) {
    open.module->C_DestroyObject(open.session, private_half);
    open.module->C_DestroyObject(open.session, public_half);
    throw Error("the token does not say that the key it made stays inside: take another token");
  }
  std::array<std::byte, kPointSize> point{};
  CK_ATTRIBUTE its_point{CKA_EC_POINT, point.data(), point.size()};
  check(open.module->C_GetAttributeValue(open.session, public_half, &its_point, 1), "give its public key");
  const bool is_point = its_point.ulValueLen == point.size() && point[0] == std::byte{0x04} &&
                        point[1] == std::byte{kPointSize - 2} && point[2] == std::byte{0x04};
  if (!is_point) throw Error("the token gives its public key in a form that is not that of PKCS#11");
  const ByteView coordinates = ByteView(point).subspan(3);
  return crypto::p256_public_key(coordinates.first(kCoordinateSize), coordinates.last(kCoordinateSize));
}

Bytes Pkcs11Key::sign(ByteView message) {
  const Connection& open = connection();
  try {
    CK_MECHANISM mechanism{CKM_ECDSA, nullptr, 0};
    check(open.module->C_SignInit(open.session, &mechanism, open.private_key(id_)), "sign");
    crypto::Sha256Digest hash = crypto::sha256(message);
    std::array<std::byte, 2 * kCoordinateSize> numbers{};
    CK_ULONG size = numbers.size();
    check(open.module->C_Sign(open.session, reinterpret_cast<unsigned char*>(hash.data()), hash.size(),
                              reinterpret_cast<unsigned char*>(numbers.data()), &size),
          "sign");
    if (size != numbers.size()) throw Error("the token gives a signature that is not of P-256");
    const ByteView both(numbers);
    return crypto::ecdsa_signature(both.first(kCoordinateSize), both.last(kCoordinateSize));
  } catch (const Error&) {
    connection_.reset();  // a token that was taken out and put back knows no session
    throw;
  }
}

}  // namespace kiroku::recorder
