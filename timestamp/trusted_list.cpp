#include "timestamp/trusted_list.h"

#include <algorithm>
#include <charconv>
#include <functional>
#include <pugixml.hpp>
#include <utility>

#include <openssl/x509.h>

#include "base/error.h"
#include "base/printable.h"
#include "crypto/encoding.h"
#include "crypto/openssl_handles.h"
#include "timestamp/asn1_objects.h"

namespace kiroku::timestamp {
namespace {

constexpr std::string_view kNamespace = "http://uri.etsi.org/02231/v2#";
constexpr std::string_view kQualifiedTimeStamps = "http://uri.etsi.org/TrstSvc/Svctype/TSA/QTST";
constexpr std::string_view kGranted = "http://uri.etsi.org/TrstSvc/TrustedList/Svcstatus/granted";
constexpr std::size_t kMostServices = 10'000, kMostStatuses = 1'000, kMostCertificates = 100;
constexpr std::size_t kLongestName = 200;

std::string_view local_name(const pugi::xml_node& node) {
  const std::string_view name = node.name();
  const std::size_t colon = name.find(':');
  return colon == std::string_view::npos ? name : name.substr(colon + 1);
}

/// The first child of that name, whatever prefix the list gives its namespace.
pugi::xml_node child(const pugi::xml_node& node, std::string_view name) {
  return node.find_child([&](const pugi::xml_node& each) { return local_name(each) == name; });
}

std::vector<pugi::xml_node> children(const pugi::xml_node& node, std::string_view name) {
  std::vector<pugi::xml_node> out;
  for (const pugi::xml_node& each : node.children())
    if (local_name(each) == name) out.push_back(each);
  return out;
}

std::string text_in(const pugi::xml_node& node) {
  std::string text = node.text().get();
  constexpr const char* kSpace = " \t\r\n";
  text.erase(0, text.find_first_not_of(kSpace));
  text.erase(text.find_last_not_of(kSpace) + 1);
  return text;
}

/// In English, else in the language that comes first.
std::string name_in(const pugi::xml_node& names) {
  const std::vector<pugi::xml_node> all = children(names, "Name");
  const auto english = std::ranges::find_if(all, [](const pugi::xml_node& name) {
    return std::string_view(name.attribute("xml:lang").value()) == "en";
  });
  const std::string name = english != all.end() ? text_in(*english) : all.empty() ? "" : text_in(all.front());
  return kiroku::printable(std::string_view(name).substr(0, kLongestName));
}

Certificate x509(ByteView der) {
  const unsigned char* data = crypto::openssl_bytes(der);
  return Certificate(d2i_X509(nullptr, &data, static_cast<long>(der.size())));
}

class Reading {
 public:
  explicit Reading(const std::string& name) : name_(name) {}

  TrustedList read(std::string_view xml) {
    if (xml.size() > kLongestTrustedList) fail("it has more than 64 MiB");
    pugi::xml_document document;
    const pugi::xml_parse_result parsed = document.load_buffer(xml.data(), xml.size());
    if (!parsed)
      fail("it is no XML: " + std::string(parsed.description()) + " at byte " +
           std::to_string(parsed.offset));
    const pugi::xml_node root = document.document_element();
    if (local_name(root) != "TrustServiceStatusList" || !has_namespace(root))
      fail("it is no trusted list (ETSI TS 119 612)");
    const pugi::xml_node scheme = child(root, "SchemeInformation");
    TrustedList list;
    list.territory = kiroku::printable(text_in(child(scheme, "SchemeTerritory")).substr(0, kLongestName));
    const std::string sequence = text_in(child(scheme, "TSLSequenceNumber"));
    if (std::from_chars(sequence.data(), sequence.data() + sequence.size(), list.sequence).ec != std::errc{})
      fail("it has no sequence number");
    list.issued = time_in(child(scheme, "ListIssueDateTime"), "its time of issue");
    if (const pugi::xml_node next = child(child(scheme, "NextUpdate"), "dateTime"))
      list.next_update = time_in(next, "its next update");
    for (const pugi::xml_node& provider :
         children(child(root, "TrustServiceProviderList"), "TrustServiceProvider"))
      take_provider(provider, list);
    return list;
  }

 private:
  [[noreturn]] void fail(const std::string& why) const {
    throw Error("cannot read the trusted list " + name_ + ": " + why);
  }

  static bool has_namespace(const pugi::xml_node& root) {
    const std::string_view name = root.name();
    const std::size_t colon = name.find(':');
    const std::string attribute =
        colon == std::string_view::npos ? "xmlns" : "xmlns:" + std::string(name.substr(0, colon));
    return root.attribute(attribute.c_str()).value() == kNamespace;
  }

  [[nodiscard]] UtcTime time_in(const pugi::xml_node& node, const std::string& what) const {
    const std::optional<UtcTime> time = parse_utc(text_in(node));
    if (!time)
      fail(what + " is '" + kiroku::printable(text_in(node).substr(0, kLongestName)) +
           "', which is no time in UTC");
    return *time;
  }

  void take_provider(const pugi::xml_node& provider, TrustedList& list) const {
    const std::string name = name_in(child(child(provider, "TSPInformation"), "TSPName"));
    for (const pugi::xml_node& service : children(child(provider, "TSPServices"), "TSPService")) {
      const pugi::xml_node information = child(service, "ServiceInformation");
      std::vector<pugi::xml_node> instances{information};
      for (const pugi::xml_node& earlier :
           children(child(service, "ServiceHistory"), "ServiceHistoryInstance"))
        instances.push_back(earlier);
      if (std::ranges::none_of(instances, is_for_time_stamps)) continue;
      if (list.services.size() == kMostServices) fail("it has more than 10,000 services");
      list.services.push_back(service_of(name, information, instances));
    }
  }

  static bool is_for_time_stamps(const pugi::xml_node& instance) {
    return text_in(child(instance, "ServiceTypeIdentifier")) == kQualifiedTimeStamps;
  }

  [[nodiscard]] QualifiedService service_of(const std::string& provider, const pugi::xml_node& information,
                                            const std::vector<pugi::xml_node>& instances) const {
    QualifiedService service;
    service.provider = provider;
    service.name = name_in(child(information, "ServiceName"));
    if (instances.size() > kMostStatuses) fail("a service of " + provider + " has more than 1,000 statuses");
    for (const pugi::xml_node& instance : instances) {
      const std::string status = text_in(child(instance, "ServiceStatus"));
      service.history.push_back(
          {time_in(child(instance, "StatusStartingTime"), "the time of a status"),
           is_for_time_stamps(instance) && status == kGranted,
           kiroku::printable(status.substr(status.rfind('/') + 1).substr(0, kLongestName))});
    }
    std::ranges::stable_sort(service.history, std::greater<>{}, &ServiceStatus::since);
    for (const pugi::xml_node& id : children(child(information, "ServiceDigitalIdentity"), "DigitalId")) {
      for (const pugi::xml_node& certificate : children(id, "X509Certificate")) {
        if (service.certificates.size() == kMostCertificates)
          fail("a service of " + provider + " has more than 100 certificates");
        service.certificates.push_back(certificate_of(certificate, provider));
      }
    }
    return service;
  }

  [[nodiscard]] Bytes certificate_of(const pugi::xml_node& node, const std::string& provider) const {
    std::string text = text_in(node);
    std::erase_if(text, [](char c) { return c == '\n' || c == '\r' || c == ' ' || c == '\t'; });
    const std::optional<Bytes> der = crypto::from_base64(text, crypto::Base64Padding::kPadded);
    if (!der || !x509(*der)) fail("a certificate of " + provider + " cannot be read");
    return *der;
  }

  const std::string& name_;
};

/// Whether two certificates are of one name and one key: a list may hold an older or a cross-certified one.
bool is_same_service(ByteView one, ByteView other) {
  const auto a = x509(one), b = x509(other);
  if (!a || !b || X509_NAME_cmp(X509_get_subject_name(a.get()), X509_get_subject_name(b.get())) != 0)
    return false;
  const auto key = [](X509* certificate) {
    unsigned char* der = nullptr;
    const int size = i2d_X509_PUBKEY(X509_get_X509_PUBKEY(certificate), &der);
    std::string out =
        size > 0 ? std::string(reinterpret_cast<const char*>(der), static_cast<std::size_t>(size)) : "";
    OPENSSL_free(der);
    return out;
  };
  const std::string its = key(a.get());
  return !its.empty() && its == key(b.get());
}

std::string day(UtcTime time) { return format_utc(time).substr(0, 10); }

std::string list_words(const TrustedList& list) {
  return "the trusted list of " + list.territory + ", number " + std::to_string(list.sequence) + " of " +
         day(list.issued);
}

/// One service that is in the token's path, at the token's time.
Qualification judge_service(const TrustedList& list, const QualifiedService& service, UtcTime time) {
  using Answer = Qualification::Answer;
  const std::string where =
      "by " + list_words(list) + ", the service '" + service.name + "' of " + service.provider;
  if (list.next_update && time > *list.next_update) {
    return {Answer::kUnknown, "the token is of " + day(time) + ", and " + list_words(list) + " tells until " +
                                  day(*list.next_update) + ": give a newer one"};
  }
  const auto then = std::ranges::find_if(service.history,
                                         [&](const ServiceStatus& status) { return status.since <= time; });
  if (then == service.history.end())
    return {Answer::kNotQualified, where + " had no status yet on " + day(time)};
  if (!then->granted) return {Answer::kNotQualified, where + " was '" + then->name + "' on " + day(time)};
  return {Answer::kQualified, where + " was granted from " + day(then->since) + " on"};
}

}  // namespace

TrustedList parse_trusted_list(std::string_view xml, const std::string& name) {
  return Reading(name).read(xml);
}

Qualification judge_qualification(const TokenJudgement& token, const std::vector<TrustedList>& lists) {
  using Answer = Qualification::Answer;
  if (token.code != TokenCode::kValid || !token.info) return {Answer::kUnknown, "the token is not valid"};
  std::optional<Qualification> found;
  for (const TrustedList& list : lists) {
    for (const QualifiedService& service : list.services) {
      const bool is_in_path = std::ranges::any_of(service.certificates, [&](const Bytes& listed) {
        return std::ranges::any_of(
            token.chain, [&](const Bytes& certificate) { return is_same_service(listed, certificate); });
      });
      if (!is_in_path) continue;
      Qualification judged = judge_service(list, service, token.info->gen_time);
      // One granted service suffices; that a list cannot tell says more than that another service was
      // withdrawn.
      if (judged.answer == Answer::kQualified) return judged;
      if (!found || judged.answer == Answer::kUnknown) found = std::move(judged);
    }
  }
  if (found) return *std::move(found);
  return {Answer::kUnknown,
          "no list that was given names a certificate of the token's path as that of a qualified "
          "time-stamping service"};
}

}  // namespace kiroku::timestamp
