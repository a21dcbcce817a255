#include "viewer/report/pdf_writer.h"

#include <algorithm>
#include <array>
#include <cairo-pdf.h>
#include <cstdio>
#include <functional>
#include <memory>
#include <utility>

#include "base/error.h"
#include "viewer/report/archival_pdf.h"
#include "viewer/report/document_parts.h"
#include "viewer/report/texts.h"
#include "viewer/report/typesetter.h"

namespace kiroku::report {
namespace {

// ISO 216 A4 in points, and its margins.
constexpr double kPageWidth = 595.276, kPageHeight = 841.89;
constexpr double kLeft = (kPageWidth - kTextWidth) / 2, kTop = 64, kBottom = kPageHeight - 64;
constexpr double kHead = 40, kFoot = kPageHeight - 36;
constexpr double kPadX = 4, kPadY = 3.2;

struct Colour {
  double red, green, blue;
};
constexpr Colour kBlack{0.07, 0.07, 0.07}, kGrey{0.40, 0.40, 0.40}, kRule{0.78, 0.80, 0.82},
    kShade{0.955, 0.96, 0.965};

Colour colour_of(Tone tone) {
  switch (tone) {
    case Tone::kGood:
      return {0.07, 0.36, 0.19};
    case Tone::kCaution:
      return {0.50, 0.32, 0.00};
    case Tone::kBad:
      return {0.62, 0.09, 0.09};
    case Tone::kPlain:
      break;
  }
  return kBlack;
}

Colour colour_of(Ink ink) {
  unsigned red = 0, green = 0, blue = 0;
  std::sscanf(ink_hex(ink), "#%2x%2x%2x", &red, &green, &blue);  // NOLINT(cert-err34-c): our own constant
  return {red / 255.0, green / 255.0, blue / 255.0};
}

void set_colour(cairo_t* canvas, const Colour& colour) {
  cairo_set_source_rgb(canvas, colour.red, colour.green, colour.blue);
}

void fill(cairo_t* canvas, double x, double y, double width, double height, const Colour& colour) {
  set_colour(canvas, colour);
  cairo_rectangle(canvas, x, y, width, height);
  cairo_fill(canvas);
}

void stroke(cairo_t* canvas, double x0, double y0, double x1, double y1, double width, const Colour& colour) {
  set_colour(canvas, colour);
  cairo_set_line_width(canvas, width);
  cairo_move_to(canvas, x0, y0);
  cairo_line_to(canvas, x1, y1);
  cairo_stroke(canvas);
}

/// Symbol and words, so that colour is never alone.
std::string with_symbol(Tone tone, const std::string& words) {
  const std::string symbol(symbol_of(tone));
  return symbol.empty() ? words : symbol + " " + words;
}

using Drawing = std::function<void(cairo_t*)>;
struct OutlineEntry {
  int level;
  std::string text;
  std::size_t page;
  double y;
};

/// Breaks blocks into pages. Nothing is drawn before the number of pages is known.
class Layout {
 public:
  Layout(const Document& document, const Typesetter& typesetter) : document_(document), type_(typesetter) {
    pages_.emplace_back();
    lay_title();
    for (std::size_t i = 0; i < document.blocks.size(); ++i) {
      const bool before_whole = i + 1 < document.blocks.size() &&
                                std::holds_alternative<Heading>(document.blocks[i]) &&
                                std::holds_alternative<Chain>(document.blocks[i + 1]);
      std::visit([&](const auto& block) { lay(block, before_whole); }, document.blocks[i]);
    }
  }

  [[nodiscard]] const std::vector<std::vector<Drawing>>& pages() const { return pages_; }
  [[nodiscard]] const std::vector<OutlineEntry>& outline() const { return outline_; }

 private:
  using Text = std::shared_ptr<const SetText>;
  /// What runs over onto a page as its first lines alone has no page for itself.
  static constexpr double kRest = 120;

  [[nodiscard]] Text set(const std::string& text, const TextStyle& style, double width) const {
    return std::make_shared<SetText>(type_.set(text, style, width));
  }
  void draw(Drawing drawing) { pages_.back().push_back(std::move(drawing)); }
  void break_page() {
    pages_.emplace_back();
    y_ = kTop;
  }
  void need(double height) {
    if (y_ + height > kBottom && y_ > kTop) break_page();
  }
  void space(double height) {
    if (y_ > kTop) y_ += height;
  }

  /// Lines [first, last) at (x, y), marked for readers as what they are.
  static Drawing drawing_of(Text text, double x, double y, int first, int last, const Colour& colour,
                            const char* tag) {
    return [text = std::move(text), x, y, first, last, colour, tag](cairo_t* canvas) {
      cairo_tag_begin(canvas, tag, nullptr);
      set_colour(canvas, colour);
      text->draw(canvas, x, y, first, last);
      cairo_tag_end(canvas, tag);
    };
  }
  void draw_whole(const Text& text, double x, double y, const Colour& colour, const char* tag = "P") {
    draw(drawing_of(text, x, y, 0, text->lines(), colour, tag));
  }

  /// Line after line, over pages where it must be.
  void flow(const Text& text, double x, const Colour& colour, const char* tag = "P") {
    for (int first = 0; first < text->lines();) {
      need(text->line_height(first));
      int last = first;
      double height = 0;
      while (last < text->lines() && y_ + height + text->line_height(last) <= kBottom + 0.01)
        height += text->line_height(last++);
      last = std::max(last, first + 1);
      draw(drawing_of(text, x, y_, first, last, colour, tag));
      y_ += height;
      first = last;
    }
  }

  void lay_title() {
    y_ = 52;
    const Text title = set(document_.title, {22, Face::kStrong}, kTextWidth);
    draw_whole(title, kLeft, y_, kBlack, "H1");
    y_ += title->height() + 1;
    const Text subtitle = set(document_.subtitle, {11}, kTextWidth);
    draw_whole(subtitle, kLeft, y_, kGrey);
    y_ += subtitle->height() + 8;
    draw([y = y_](cairo_t* canvas) { stroke(canvas, kLeft, y, kLeft + kTextWidth, y, 1.2, kBlack); });
    y_ += 14;
  }

  void lay(const Heading& heading, bool keep_whole) {
    const bool first = heading.level == 1;
    const Text text = set(heading.text, {first ? 13.0 : 10.5, Face::kStrong}, kTextWidth);
    space(first ? 18 : 11);
    // Never at the foot of a page without what it is about.
    need(text->height() + (keep_whole ? 400 : 74));
    outline_.push_back({heading.level, heading.text, pages_.size(), y_});
    draw_whole(text, kLeft, y_, kBlack, first ? "H2" : "H3");
    y_ += text->height() + 5;
  }

  void lay(const Paragraph& paragraph, bool /*keep_whole*/) {
    const bool small = paragraph.style == ParagraphStyle::kSmall;
    space(2);
    flow(set(paragraph.text, {small ? 8.0 : 9.5}, kTextWidth), kLeft, small ? kGrey : kBlack);
    y_ += 5;
  }

  void lay(const Statement& statement, bool /*keep_whole*/) {
    constexpr double kInset = 16, kBar = 6;
    const double width = kTextWidth - 2 * kInset;
    const Colour colour = colour_of(statement.tone);
    std::vector<std::pair<Text, Colour>> parts{
        {set(with_symbol(statement.tone, statement.word), {19, Face::kStrong}, width), colour},
        {set(statement.sentence, {11}, width), kBlack}};
    for (const std::string& remark : statement.remarks)
      parts.emplace_back(set("• " + remark, {9.5}, width), kBlack);
    double height = 2 * 11 + 6.0 * static_cast<double>(parts.size() - 1);
    for (const auto& [text, ink] : parts) height += text->height();
    need(height);
    draw([y = y_, height, colour](cairo_t* canvas) {
      fill(canvas, kLeft, y, kTextWidth, height, kShade);
      fill(canvas, kLeft, y, kBar, height, colour);
      set_colour(canvas, colour);
      cairo_set_line_width(canvas, 0.8);
      cairo_rectangle(canvas, kLeft, y, kTextWidth, height);
      cairo_stroke(canvas);
    });
    double y = y_ + 11;
    for (const auto& [text, ink] : parts) {
      draw_whole(text, kLeft + kInset, y, ink);
      y += text->height() + 6;
    }
    y_ += height + 6;
  }

  struct Row {
    std::vector<Text> texts;
    std::vector<Colour> colours;
    double height = 0;
  };

  [[nodiscard]] Row set_row(const std::vector<Cell>& cells, const Table& table,
                            const std::vector<double>& widths, bool head) const {
    Row row;
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const Cell& cell = cells[i];
      const double size = head ? 8 : cell.face == Face::kMono ? 7 : 8.5;
      row.texts.push_back(set(with_symbol(cell.tone, cell.text),
                              {size, head ? Face::kStrong : cell.face, table.columns[i].alignment},
                              widths[i] - 2 * kPadX));
      row.colours.push_back(head ? kGrey : colour_of(cell.tone));
      row.height = std::max(row.height, row.texts.back()->height());
    }
    row.height += 2 * kPadY;
    return row;
  }

  void draw_row(const Row& row, const std::vector<double>& widths, double rule_width, const Colour& rule) {
    double x = kLeft;
    for (std::size_t i = 0; i < row.texts.size(); ++i) {
      draw_whole(row.texts[i], x + kPadX, y_ + kPadY, row.colours[i]);
      x += widths[i];
    }
    y_ += row.height;
    draw([y = y_, rule_width, rule](cairo_t* canvas) {
      stroke(canvas, kLeft, y, kLeft + kTextWidth, y, rule_width, rule);
    });
  }

  /// A row that is higher than a page: cell after cell.
  void flow_row(const Row& row) {
    for (std::size_t i = 0; i < row.texts.size(); ++i) flow(row.texts[i], kLeft + kPadX, row.colours[i]);
    y_ += kPadY;
  }

  void lay(const Table& table, bool /*keep_whole*/) {
    double shares = 0;
    for (const Column& column : table.columns) shares += column.share;
    std::vector<double> widths;
    std::vector<Cell> titles;
    bool has_head = false;
    for (const Column& column : table.columns) {
      widths.push_back(column.share / shares * kTextWidth);
      titles.push_back({column.title});
      has_head = has_head || !column.title.empty();
    }
    const Row head = set_row(titles, table, widths, true);
    const auto draw_head = [&] {
      if (has_head) draw_row(head, widths, 0.9, kGrey);
    };
    bool begun = false;
    for (const std::vector<Cell>& cells : table.rows) {
      const Row row = set_row(cells, table, widths, false);
      if (row.height > kBottom - kTop - head.height) {
        flow_row(row);
        continue;
      }
      if (!begun) need(row.height + head.height);
      if (y_ + row.height > kBottom) {
        break_page();
        begun = false;
      }
      if (!begun) draw_head();
      begun = true;
      draw_row(row, widths, 0.4, kRule);
    }
    y_ += 6;
  }

  void lay(const Chain& chain, bool /*keep_whole*/) {
    constexpr double kBox = 168, kGap = 12, kBond = 22;
    space(3);
    for (std::size_t i = 0; i < chain.links.size(); ++i) {
      const Chain::Link& link = chain.links[i];
      const Colour colour = colour_of(link.title.tone);
      const Text title = set(link.title.text, {10, Face::kStrong}, kBox - 18);
      const Text answer = set(with_symbol(link.title.tone, link.answer), {8.5}, kBox - 18);
      const Text text = set(link.text, {9}, kTextWidth - kBox - kGap);
      const double inside = title->height() + 2 + answer->height();
      const double height = std::max(inside, text->height()) + 12;
      need(height + kBond);
      draw([y = y_, height, colour](cairo_t* canvas) {
        fill(canvas, kLeft, y, kBox, height, kShade);
        fill(canvas, kLeft, y, 4, height, colour);
        set_colour(canvas, kGrey);
        cairo_set_line_width(canvas, 0.6);
        cairo_rectangle(canvas, kLeft, y, kBox, height);
        cairo_stroke(canvas);
      });
      draw_whole(title, kLeft + 12, y_ + (height - inside) / 2, kBlack);
      draw_whole(answer, kLeft + 12, y_ + (height - inside) / 2 + title->height() + 2, colour);
      draw_whole(text, kLeft + kBox + kGap, y_ + (height - text->height()) / 2, kBlack);
      y_ += height;
      if (i + 1 < chain.links.size()) {
        const Text bond = set(link.bond, {8}, kBox);
        draw([y = y_](cairo_t* canvas) { arrow(canvas, kLeft + 22, y + 1, y + kBond - 1); });
        draw_whole(bond, kLeft + 32, y_ + (kBond - bond->height()) / 2, kGrey);
        y_ += kBond;
      }
    }
    y_ += 8;
  }

  static void arrow(cairo_t* canvas, double x, double from, double to) {
    stroke(canvas, x, from, x, to - 4, 1, kGrey);
    cairo_move_to(canvas, x - 3, to - 5);
    cairo_line_to(canvas, x + 3, to - 5);
    cairo_line_to(canvas, x, to);
    cairo_close_path(canvas);
    cairo_fill(canvas);
  }

  void lay(const Listing& listing, bool /*keep_whole*/) {
    constexpr double kInset = 8;
    std::vector<Text> lines;
    double height = 10;
    for (const std::string& line : listing.lines) {
      lines.push_back(set(line, {7.5, Face::kMono}, kTextWidth - 2 * kInset));
      height += lines.back()->height();
    }
    need(height);
    draw([y = y_, height](cairo_t* canvas) { fill(canvas, kLeft, y, kTextWidth, height, kShade); });
    double y = y_ + 5;
    for (const Text& line : lines) {
      draw_whole(line, kLeft + kInset, y, kBlack);
      y += line->height();
    }
    y_ += height + 6;
  }

  void lay(const Picture& picture, bool /*keep_whole*/) {
    const Text caption = set(picture.caption, {8}, kTextWidth);
    space(4);
    need(picture.figure.height + caption->height() + 4);
    draw([this, &figure = picture.figure, y = y_](cairo_t* canvas) {
      cairo_save(canvas);
      cairo_translate(canvas, kLeft, y);
      for (const Shape& shape : figure.shapes)
        std::visit([&](const auto& each) { draw_shape(canvas, each); }, shape);
      cairo_restore(canvas);
    });
    y_ += picture.figure.height + 4;
    draw_whole(caption, kLeft, y_, kGrey);
    y_ += caption->height() + 6;
  }

  static void draw_shape(cairo_t* canvas, const Area& area) {
    fill(canvas, area.x, area.y, area.width, area.height, colour_of(area.fill));
  }
  static void draw_shape(cairo_t* canvas, const Stroke& line) {
    stroke(canvas, line.x0, line.y0, line.x1, line.y1, line.width, colour_of(line.ink));
  }
  void draw_shape(cairo_t* canvas, const Lettering& lettering) const {
    const SetText text = type_.set_line(lettering.text, {lettering.size}, lettering.most);
    const double shift = lettering.anchor == Lettering::Anchor::kStart    ? 0
                         : lettering.anchor == Lettering::Anchor::kMiddle ? text.ink_width() / 2
                                                                          : text.ink_width();
    set_colour(canvas, kBlack);
    text.draw_on_baseline(canvas, lettering.x - shift, lettering.baseline);
  }

  void lay(const PageBreak& /*page_break*/, bool /*keep_whole*/) {
    const bool is_rest = pages_.size() > 1 && y_ < kTop + kRest;
    if (y_ > kTop && !is_rest) break_page();
  }

  const Document& document_;
  const Typesetter& type_;
  std::vector<std::vector<Drawing>> pages_;
  std::vector<OutlineEntry> outline_;
  double y_ = kTop;
};

void draw_frame(cairo_t* canvas, const Document& document, const Typesetter& type, std::size_t page,
                std::size_t pages) {
  const TextStyle style{8};
  set_colour(canvas, kGrey);
  const auto right = [&](const std::string& text, double y) {
    const SetText set = type.set_line(text, style, 0);
    set.draw_on_baseline(canvas, kLeft + kTextWidth - set.ink_width(), y);
  };
  if (page > 1) {
    type.set_line(document.running_head, style, kTextWidth / 2).draw_on_baseline(canvas, kLeft, kHead);
    right(document.identifier, kHead);
    stroke(canvas, kLeft, kHead + 6, kLeft + kTextWidth, kHead + 6, 0.4, kRule);
  }
  stroke(canvas, kLeft, kFoot - 13, kLeft + kTextWidth, kFoot - 13, 0.4, kRule);
  set_colour(canvas, kGrey);
  type.set_line(document.running_foot, style, kTextWidth - 60).draw_on_baseline(canvas, kLeft, kFoot);
  right(say(document.language, "page", {std::to_string(page), std::to_string(pages)}), kFoot);
}

void set_metadata(cairo_surface_t* surface, const Document& document) {
  const std::string date = format_utc(document.made).substr(0, 19) + "Z";
  const auto set = [&](cairo_pdf_metadata_t what, const std::string& value) {
    cairo_pdf_surface_set_metadata(surface, what, value.c_str());
  };
  set(CAIRO_PDF_METADATA_TITLE, document.title + " · " + document.identifier);
  set(CAIRO_PDF_METADATA_AUTHOR, document.author);
  set(CAIRO_PDF_METADATA_SUBJECT, document.subject);
  set(CAIRO_PDF_METADATA_CREATOR, document.program);
  set(CAIRO_PDF_METADATA_CREATE_DATE, date);
  set(CAIRO_PDF_METADATA_MOD_DATE, date);
}

cairo_status_t take(void* closure, const unsigned char* data, unsigned size) {
  append(*static_cast<Bytes*>(closure), {reinterpret_cast<const std::byte*>(data), size});
  return CAIRO_STATUS_SUCCESS;
}

}  // namespace

Bytes write_pdf(const Document& document) {
  const Typesetter type(document.language);
  const Layout layout(document, type);
  Bytes pdf;
  const PangoHandle<cairo_surface_t> surface(
      cairo_pdf_surface_create_for_stream(take, &pdf, kPageWidth, kPageHeight));
  set_metadata(surface.get(), document);
  {
    const PangoHandle<cairo_t> canvas(cairo_create(surface.get()));
    for (std::size_t page = 0; page < layout.pages().size(); ++page) {
      for (const Drawing& draw : layout.pages()[page]) draw(canvas.get());
      draw_frame(canvas.get(), document, type, page + 1, layout.pages().size());
      cairo_show_page(canvas.get());
    }
    int parent = CAIRO_PDF_OUTLINE_ROOT;
    for (const OutlineEntry& entry : layout.outline()) {
      std::array<char, 64> where{};
      std::snprintf(where.data(), where.size(), "page=%zu pos=[%.1f %.1f]", entry.page, kLeft, entry.y);
      const int id =
          cairo_pdf_surface_add_outline(surface.get(), entry.level == 1 ? CAIRO_PDF_OUTLINE_ROOT : parent,
                                        entry.text.c_str(), where.data(), CAIRO_PDF_OUTLINE_FLAG_OPEN);
      if (entry.level == 1) parent = id;
    }
    cairo_surface_finish(surface.get());
    for (const cairo_status_t status : {cairo_status(canvas.get()), cairo_surface_status(surface.get())}) {
      if (status != CAIRO_STATUS_SUCCESS) {
        throw Error(std::string("cannot write the document as PDF: Cairo says: ") +
                    cairo_status_to_string(status));
      }
    }
  }
  return make_archival(pdf, document);
}

}  // namespace kiroku::report
