// Canonical XML: one form for the same document, however it was written. Canonical XML 1.0 (W3C, 2001) and
// Exclusive XML Canonicalization 1.0 (W3C, 2002), each with and without comments, of a whole document or of
// one element with all that is in it. Documents may be an attacker's: depth, attributes, marks and output are
// bounded. Pure functions, thread-safe.
//
// A document with a DOCTYPE is refused: its entities and attributes by default would have to be read. So are
// names whose prefix nothing declares, and an attribute that stands twice; other encodings than UTF-8,
// XML 1.1, characters that XML does not have, entities that nothing declares, and a declaration behind the
// beginning. Whatever stands in a document that is read is in its canonical form, or is what that form leaves
// out.
#pragma once

#include <compare>
#include <cstddef>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>

namespace kiroku::evidence {

// What is beyond these limits is refused.
inline constexpr int kDeepestXml = 100;  // elements within each other
inline constexpr std::size_t kMostXmlAttributes =
    64;  // of one element, declarations of namespaces among them
/// Tags, values of attributes, comments, processing instructions and CDATA sections of one document.
inline constexpr std::size_t kMostXmlMarks = 1'000'000;
inline constexpr std::size_t kLongestXml = std::size_t{64} << 20U;            // bytes that are read
inline constexpr std::size_t kLongestCanonicalXml = std::size_t{128} << 20U;  // bytes that are written

struct Canonicalization {
  bool exclusive = false, with_comments = false;
  friend auto operator<=>(const Canonicalization&, const Canonicalization&) = default;
};
/// The one of this URI; nothing for others.
std::optional<Canonicalization> canonicalization_named(std::string_view uri);

/// Reads a document so that its canonical form can be made. Throws kiroku::Error, one sentence, for what is
/// no XML or is refused.
pugi::xml_document parse_xml(std::string_view xml);
/// The namespace of an element of such a document.
std::string_view namespace_of(const pugi::xml_node& element);
/// Its name without prefix.
std::string_view local_name_of(const pugi::xml_node& element);
/// What a document says, for a sentence about it: its first bytes, fit for a terminal.
std::string in_quotes(std::string_view text);
inline constexpr std::size_t kLongestQuoted = 80;

/// UTF-8. Throws kiroku::Error where it would be longer than allowed.
std::string canonical_document(const pugi::xml_document& document, Canonicalization how);
/// Of one element of such a document, and what is in it.
std::string canonical_element(const pugi::xml_node& element, Canonicalization how);

}  // namespace kiroku::evidence
