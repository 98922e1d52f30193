#include "server/report/pose_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/report/html.h"

namespace trammel {

namespace {

constexpr double kSide = 300, kMargin = 26, kGap = 24;  // px of a view
constexpr double kLongestArrow = 0.22;                  // of the view's side

/// A view of space on the page: which axes of B go to the right and up.
struct PictureView {
  const char* title;
  const char* right_name;
  const char* up_name;
  int right, up;
};
constexpr PictureView kViews[] = {{"from above", "x", "y", 0, 1},
                                  {"from the side", "x", "z", 0, 2}};

/// One scale for both views, so that lengths compare.
struct PictureScale {
  Vector3 low = Vector3::Zero(), high = Vector3::Zero();  // mm; the base is always inside
  double px_per_mm = 1;
  double times = 1;  // arrows are drawn so much longer
};

/// The largest of 1, 2, 5, 10, 20 ... that is not above `value`.
double round_factor(double value) {
  const double decade = std::pow(10, std::floor(std::log10(value)));
  for (const double step : {5.0, 2.0})
    if (step * decade <= value) return step * decade;
  return decade;
}

PictureScale picture_scale(const std::vector<DrawnPose>& poses) {
  PictureScale scale;
  double longest = 0;
  for (const DrawnPose& pose : poses) {
    scale.low = scale.low.cwiseMin(pose.place_mm);
    scale.high = scale.high.cwiseMax(pose.place_mm);
    longest = std::max(longest, pose.off_mm.norm());
  }
  const double widest = std::max(1.0, (scale.high - scale.low).maxCoeff());
  const double inner = kSide - 2 * kMargin;
  scale.px_per_mm = inner / widest;
  if (longest > 0) scale.times = round_factor(kLongestArrow * inner / scale.px_per_mm / longest);
  return scale;
}

std::string picture_view(const std::vector<DrawnPose>& poses, const PictureView& view,
                         const PictureScale& scale, double left) {
  const double middle_right = (scale.low(view.right) + scale.high(view.right)) / 2;
  const double middle_up = (scale.low(view.up) + scale.high(view.up)) / 2;
  const auto x = [&](const Vector3& p) {
    return left + kSide / 2 + scale.px_per_mm * (p(view.right) - middle_right);
  };
  const auto y = [&](const Vector3& p) {
    return kSide / 2 - scale.px_per_mm * (p(view.up) - middle_up);
  };
  const Vector3 base = Vector3::Zero();
  std::string svg = fmt::format(
      R"(<rect class="frame" x="{:.1f}" y="0.5" width="{:.1f}" height="{:.1f}"/><text x="{:.1f}" y="16">{}</text><text class="axis" x="{:.1f}" y="{:.1f}">{} →, {} ↑</text><rect class="base" x="{:.1f}" y="{:.1f}" width="10" height="10"/>)",
      left + 0.5, kSide - 1, kSide - 1, left + 8, view.title, left + kSide - 58, kSide - 8,
      view.right_name, view.up_name, x(base) - 5, y(base) - 5);
  for (const DrawnPose& pose : poses) {
    const Vector3 tip = pose.place_mm + scale.times * pose.off_mm;
    svg += fmt::format(
        R"(<g{}><title>{}: {:.4f} mm</title><path d="M{:.1f} {:.1f}L{:.1f} {:.1f}"/><circle cx="{:.1f}" cy="{:.1f}" r="3.5"/></g>)",
        pose.marked ? " class=\"marked\"" : "", html_text(pose.name), pose.off_mm.norm(),
        x(pose.place_mm), y(pose.place_mm), x(tip), y(tip), x(pose.place_mm), y(pose.place_mm));
  }
  return svg;
}

}  // namespace

std::string pose_picture(const std::vector<DrawnPose>& poses) {
  if (poses.empty()) return "";
  const PictureScale scale = picture_scale(poses);
  std::string views;
  double left = 0;
  for (const PictureView& view : kViews) {
    views += picture_view(poses, view, scale, left);
    left += kSide + kGap;
  }
  return fmt::format(
      "<svg class=\"pose_picture\" viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\">{}</svg>\n<p "
      "class=\"note\">Where the poses are in the robot's base (square), and what each is off by, "
      "drawn {:.0f} times as long.</p>",
      left - kGap, kSide, views, scale.times);
}

}  // namespace trammel
