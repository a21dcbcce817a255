#include "viewer/report/typesetter.h"

#include <cstring>
#include <utility>

#include "base/error.h"

namespace kiroku::report {
namespace {

constexpr const char* kText = "DejaVu Sans";
constexpr const char* kMono = "DejaVu Sans Mono";
constexpr const char* kJapanese = "IPAPGothic";

double points(int pango_units) { return static_cast<double>(pango_units) / PANGO_SCALE; }

PangoRectangle extents(PangoLayoutLine* line) {
  PangoRectangle logical;
  pango_layout_line_get_extents(line, nullptr, &logical);
  return logical;
}

}  // namespace

SetText::SetText(PangoHandle<PangoLayout> layout, double width, double leading)
    : layout_(std::move(layout)), leading_(leading) {
  if (width > 0) pango_layout_set_width(layout_.get(), static_cast<int>(width * PANGO_SCALE));
}

int SetText::lines() const { return pango_layout_get_line_count(layout_.get()); }

double SetText::line_height(int line) const {
  return leading_ * points(extents(pango_layout_get_line_readonly(layout_.get(), line)).height);
}

double SetText::height() const {
  double height = 0;
  for (int line = 0; line < lines(); ++line) height += line_height(line);
  return height;
}

double SetText::ink_width() const {
  PangoRectangle logical;
  pango_layout_get_extents(layout_.get(), nullptr, &logical);
  return points(logical.width);
}

void SetText::draw(cairo_t* canvas, double x, double y, int first, int last) const {
  const double width = points(pango_layout_get_width(layout_.get()));
  const bool right = pango_layout_get_alignment(layout_.get()) == PANGO_ALIGN_RIGHT && width > 0;
  for (int i = first; i < last; ++i) {
    PangoLayoutLine* line = pango_layout_get_line_readonly(layout_.get(), i);
    const PangoRectangle logical = extents(line);
    const double above = (leading_ - 1) / 2 * points(logical.height) - points(logical.y);
    cairo_move_to(canvas, right ? x + width - points(logical.width) : x, y + above);
    pango_cairo_show_layout_line(canvas, line);
    y += line_height(i);
  }
}

void SetText::draw_on_baseline(cairo_t* canvas, double x, double y) const {
  cairo_move_to(canvas, x, y);
  pango_cairo_show_layout_line(canvas, pango_layout_get_line_readonly(layout_.get(), 0));
}

Typesetter::Typesetter(Language language)
    : language_(language),
      fonts_(pango_cairo_font_map_new()),
      context_((pango_cairo_font_map_set_resolution(PANGO_CAIRO_FONT_MAP(fonts_.get()), 72),
                pango_font_map_create_context(fonts_.get()))) {
  require_font(kText, "fonts-dejavu-core");
  require_font(kMono, "fonts-dejavu-core");
  if (language == Language::kJapanese) require_font(kJapanese, "fonts-ipafont-gothic");
  // Where letters stand does not depend on a screen's pixels.
  const PangoHandle<cairo_font_options_t> options(cairo_font_options_create());
  cairo_font_options_set_hint_style(options.get(), CAIRO_HINT_STYLE_NONE);
  cairo_font_options_set_hint_metrics(options.get(), CAIRO_HINT_METRICS_OFF);
  pango_cairo_context_set_font_options(context_.get(), options.get());
  pango_context_set_round_glyph_positions(context_.get(), FALSE);
  pango_context_set_language(context_.get(),
                             pango_language_from_string(std::string(language_tag(language)).c_str()));
}

void Typesetter::require_font(const char* family, const char* package) const {
  PangoFontFamily** families = nullptr;
  int count = 0;
  pango_font_map_list_families(fonts_.get(), &families, &count);
  bool found = false;
  for (int i = 0; i < count; ++i)
    found = found || std::strcmp(pango_font_family_get_name(families[i]), family) == 0;
  g_free(families);
  if (!found) {
    throw Error(std::string("cannot set the document: the font ") + family +
                " is not installed; install the package " + package);
  }
}

PangoHandle<PangoLayout> Typesetter::layout(std::string_view text, const TextStyle& style) const {
  PangoHandle<PangoLayout> layout(pango_layout_new(context_.get()));
  const PangoHandle<PangoFontDescription> font(pango_font_description_new());
  const bool japanese = language_ == Language::kJapanese;
  const std::string family = style.face == Face::kMono ? kMono
                             : japanese                ? std::string(kJapanese) + "," + kText
                                                       : kText;
  pango_font_description_set_family(font.get(), family.c_str());
  pango_font_description_set_size(font.get(), static_cast<int>(style.size * PANGO_SCALE));
  if (style.face == Face::kStrong) pango_font_description_set_weight(font.get(), PANGO_WEIGHT_BOLD);
  pango_layout_set_font_description(layout.get(), font.get());
  pango_layout_set_text(layout.get(), text.data(), static_cast<int>(text.size()));
  pango_layout_set_wrap(layout.get(), style.face == Face::kMono ? PANGO_WRAP_CHAR : PANGO_WRAP_WORD_CHAR);
  // A hash that is broken must not gain a character.
  const PangoHandle<PangoAttrList> attributes(pango_attr_list_new());
  pango_attr_list_insert(attributes.get(), pango_attr_insert_hyphens_new(FALSE));
  pango_layout_set_attributes(layout.get(), attributes.get());
  if (style.alignment == Alignment::kRight) pango_layout_set_alignment(layout.get(), PANGO_ALIGN_RIGHT);
  return layout;
}

SetText Typesetter::set(std::string_view text, const TextStyle& style, double width) const {
  // Japanese fonts are set solid; their lines need more air.
  return {layout(text, style), width, language_ == Language::kJapanese ? 1.4 : 1.08};
}

SetText Typesetter::set_line(std::string_view text, const TextStyle& style, double most) const {
  PangoHandle<PangoLayout> line = layout(text, style);
  pango_layout_set_single_paragraph_mode(line.get(), TRUE);
  if (most > 0) pango_layout_set_ellipsize(line.get(), PANGO_ELLIPSIZE_END);
  return {std::move(line), most, 1};
}

}  // namespace kiroku::report
