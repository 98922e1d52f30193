#include "server/report/proof_page.h"

#include <algorithm>
#include <cmath>
#include <iterator>

#include "server/report/html.h"

namespace trammel {

namespace {

double in_um(double m) { return m * 1e6; }

double share_of_tried(int count, const PutIn& size) {
  return static_cast<double>(count) / static_cast<double>(std::max(1, size.tried));
}

/// Plots shares against sizes. The sizes are logarithmic, from the smallest tried to the largest.
class Plot {
 public:
  explicit Plot(const ProvedCause& proved) : proved_(proved) {
    low_ = std::log(proved.sizes.front().effect_rms);
    high_ = std::log(proved.sizes.back().effect_rms);
  }

  [[nodiscard]] std::string svg() const {
    std::string points;
    for (const PutIn& size : proved_.sizes)
      points += fmt::format(R"(<circle cx="{:.1f}" cy="{:.1f}" r="2"/>)", x(size.effect_rms),
                            y(share_of_tried(size.named, size)));
    return fmt::format(
        R"(<svg class="proved" viewBox="0 0 {} {}" role="img"><path d="M0 {:.1f}H{}"/>)"
        R"({}{}{}{}{}{}</svg>)",
        kWidth, kHeight + kNumbers, y(kProvedShare), kWidth, mark("predicted", proved_.predicted),
        mark("size", proved_.is_proved() ? proved_.smallest : std::nullopt),
        line("found", &PutIn::found) + line("wrong", &PutIn::misnamed),
        line("right", &PutIn::named), points, numbers());
  }

 private:
  static constexpr int kWidth = 180, kHeight = 48;
  static constexpr int kNumbers = 14;  // height of the smallest and the largest size below the plot
  static constexpr double kMargin = 4;

  [[nodiscard]] double x(double size) const {
    const double share = high_ > low_ ? (std::log(size) - low_) / (high_ - low_) : 0.5;
    return kMargin + std::clamp(share, 0.0, 1.0) * (kWidth - 2 * kMargin);
  }
  [[nodiscard]] static double y(double share) {
    return kHeight - kMargin - share * (kHeight - 2 * kMargin);
  }
  [[nodiscard]] std::string line(const char* kind, int PutIn::*count) const {
    std::string path;
    for (const PutIn& size : proved_.sizes)
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", x(size.effect_rms),
                          y(share_of_tried(size.*count, size)));
    return fmt::format(R"(<path class="{}" d="{}"/>)", kind, path);
  }
  /// Empty if the size is beyond all tried sizes.
  [[nodiscard]] std::string mark(const char* kind, const std::optional<double>& size) const {
    if (!size || *size < proved_.sizes.front().effect_rms ||
        *size > proved_.sizes.back().effect_rms)
      return "";
    return fmt::format(R"(<line class="{0}" x1="{1:.1f}" x2="{1:.1f}" y1="0" y2="{2}"/>)", kind,
                       x(*size), kHeight);
  }
  [[nodiscard]] std::string numbers() const {
    const auto number = [](int at, const char* anchor, double size) {
      return fmt::format(R"(<text x="{}" y="{}" text-anchor="{}">{:.3g}</text>)", at,
                         kHeight + kNumbers - 3, anchor, in_um(size));
    };
    const double largest = proved_.sizes.back().effect_rms;
    if (proved_.sizes.size() == 1) return number(kWidth / 2, "middle", largest);
    return number(0, "start", proved_.sizes.front().effect_rms) + number(kWidth, "end", largest);
  }

  const ProvedCause& proved_;
  double low_ = 0, high_ = 0;
};

/// The effects of all sizes.
PutIn all_of(const ProvedCause& proved) {
  PutIn all;
  for (const PutIn& size : proved.sizes) {
    all.tried += size.tried;
    all.named += size.named;
    all.misnamed += size.misnamed;
  }
  return all;
}

/// The share of its largest effects that were found only in doubt.
std::string found_in_doubt(const ProvedCause& proved) {
  const PutIn& largest = proved.sizes.back();
  if (largest.found == 0) return "";
  return fmt::format("; found in doubt {} of {}", largest.found - largest.named, largest.tried);
}

std::string proved_size(const ProvedCause& proved) {
  if (proved.sizes.empty()) return "not tried";
  if (proved.never)
    return fmt::format("not named up to {:.3g}{}", in_um(proved.sizes.back().effect_rms),
                       found_in_doubt(proved));
  if (proved.is_proved())
    return fmt::format("<b>{:.3g}</b> ({:.3g} to {:.3g})", in_um(*proved.smallest),
                       in_um(*proved.from), in_um(*proved.to));
  const PutIn all = all_of(proved);
  // Without an effect that was missed the lower bound is that of the sizes tried.
  const bool has_bound = proved.from && all.named < all.tried;
  return fmt::format(
      "{}; named {} of {}",
      has_bound ? fmt::format("{:.3g} or more", in_um(*proved.from)) : "not known yet", all.named,
      all.tried);
}

HtmlRow proof_row(const ProvedCause& proved) {
  const int tried = all_of(proved).tried;
  return {{html_text(kind_in_words(proved.cause)),
           proved.cause.joint >= 0 ? fmt::format("{}", proved.cause.joint + 1) : "–",
           proved_size(proved),
           proved.predicted ? fmt::format("{:.3g}", in_um(*proved.predicted)) : "never",
           fmt::format("{}", tried), tried > 0 ? Plot(proved).svg() : ""}};
}

}  // namespace

std::string proof_section(const Proof& proof) {
  const PutIn& healthy = proof.healthy;
  PutIn all;
  for (const ProvedCause& one : proof.causes) {
    const PutIn own = all_of(one);
    all.tried += own.tried;
    all.misnamed += own.misnamed;
  }
  std::string body = fmt::format(
      "<p class=\"note\">Effects of known size were put into what the best model leaves over of "
      "this batch, its signs changed block by block, and diagnosed. {:.0f}\u00a0% of the effects "
      "of "
      "the size given are named, rightly and for sure (in brackets the 95\u00a0% interval). Plot: "
      "share named (green), share found for sure or in doubt (pale), and share with another cause "
      "named for sure (orange), by size; dashed: "
      "the size predicted; dark: the size proved.</p>\n<p>Another cause was named for sure in {} "
      "of "
      "{} diagnoses; with nothing put in, a cause was named in {} of {}.{}</p>\n",
      100 * kProvedShare, all.misnamed, all.tried, healthy.misnamed, healthy.tried,
      proof.refused > 0 ? fmt::format(" {} diagnoses refused their batch.", proof.refused) : "");
  std::vector<HtmlRow> rows;
  std::transform(proof.causes.begin(), proof.causes.end(), std::back_inserter(rows), proof_row);
  if (rows.empty()) {
    body += "<p>These poses show no cause that the best model does not have.</p>\n";
  } else {
    body += "<div class=\"wide\">" +
            html_table({"proof stacks",
                        {"cause", "joint", "named from, µm rms", "predicted, µm rms", "diagnoses",
                         "share named, by size in µm"},
                        rows}) +
            "</div>\n";
  }
  return html_section("How large an effect must be: proved in these residuals", body);
}

}  // namespace trammel
