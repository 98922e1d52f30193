#include "server/robot/three_numbers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "server/base/letters.h"
#include "server/base/units.h"

namespace trammel {

namespace {

/// The forms of makers: KUKA; FANUC, Yaskawa and ROS; RoboDK; Universal Robots; Kawasaki.
std::vector<ThreeNumbers> ways_of_makers() {
  return {{"A B C",
           "turns about z, y and x, in this order, each about the turned axis",
           {{"a", "b", "c"}, {"a", "e", "r"}},
           {2, 1, 0}},
          {"W P R",
           "turns about the fixed axes x, y and z, in this order",
           {{"w", "p", "r"}, {"roll", "pitch", "yaw"}},
           {2, 1, 0},
           true},
          {"Rx Ry Rz",
           "turns about x, y and z, in this order, each about the turned axis",
           {{"rx", "ry", "rz"}},
           {0, 1, 2}},
          {"a rotation vector", "", {{"rvx", "rvy", "rvz"}}, {}, false, true},
          {"O A T (turns about z, y, z)",
           "turns about z, y and z, in this order, each about the turned axis",
           {{"o", "a", "t"}},
           {2, 1, 2}}};
}

void add_other_orders(std::vector<ThreeNumbers>& ways) {
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      for (int k = 0; k < 3; ++k) {
        const std::array<int, 3> axes = {i, j, k};
        const auto is_there = [&](const ThreeNumbers& way) { return way.axes == axes; };
        if (i == j || j == k || std::any_of(ways.begin(), ways.end(), is_there)) continue;
        ways.push_back(
            {fmt::format("turns about {}, {}, {}", "xyz"[i], "xyz"[j], "xyz"[k]), "", {}, axes});
      }
    }
  }
}

}  // namespace

Eigen::Quaterniond ThreeNumbers::rotation(const Vector3& rad) const {
  if (is_vector) return Eigen::Quaterniond(rotation_exp(rad));
  Eigen::Quaterniond q = Eigen::Quaterniond::Identity();
  for (int k = 0; k < 3; ++k)
    q = q * Eigen::AngleAxisd(rad(from_behind ? 2 - k : k),
                              Vector3::Unit(axes[static_cast<std::size_t>(k)]));
  return q;
}

std::array<Vector3, 2> ThreeNumbers::numbers(const Matrix3& R) const {
  if (is_vector) return {rotation_log(R), rotation_log(R)};
  const auto wrapped = [&](const Vector3& turns) {
    const Vector3 within =
        turns.unaryExpr([](double angle) { return std::remainder(angle, 2 * kPi); });
    return from_behind ? Vector3(within.reverse()) : within;
  };
  const Vector3 one = R.eulerAngles(axes[0], axes[1], axes[2]);
  const double half = axes[0] == axes[2] ? 0 : kPi;
  std::array<Vector3, 2> both = {wrapped(one),
                                 wrapped({one.x() + kPi, half - one.y(), one.z() + kPi})};
  if (both[1].cwiseAbs().maxCoeff() < both[0].cwiseAbs().maxCoeff()) std::swap(both[0], both[1]);
  return both;
}

std::string ThreeNumbers::columns_text() const {
  if (columns.empty()) return "";
  std::array<std::string, 3> shown = columns.front();
  const bool long_names = shown[0].size() > 2;  // this is the spelling of rvx_rad
  for (std::string& one : shown)
    if (!long_names && !one.empty()) one[0] = upper(one[0]);
  return fmt::format("{}, {}, {}", shown[0], shown[1], shown[2]);
}

const std::vector<ThreeNumbers>& ways_of_three_numbers() {
  static const std::vector<ThreeNumbers> all = [] {
    std::vector<ThreeNumbers> ways = ways_of_makers();
    add_other_orders(ways);
    return ways;
  }();
  return all;
}

const ThreeNumbers* way_of_columns(const std::array<std::string, 3>& columns) {
  for (const ThreeNumbers& way : ways_of_three_numbers())
    if (std::find(way.columns.begin(), way.columns.end(), columns) != way.columns.end())
      return &way;
  return nullptr;
}

}  // namespace trammel
