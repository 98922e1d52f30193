// Finds which rows belong together. The distance from one measured position to the next does not
// depend on the tracker's place, and equals that of the nominal arm within millimetres. If the
// joints of a block of rows are `shift` rows away, its distances match those of the nominal arm
// `shift` rows away. For each shift one pass finds the block with the largest gain; then the next
// block beside it is searched.
#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "server/base/median.h"
#include "server/measurement/reading/catalogue.h"

namespace trammel::reading {

namespace {

using Shift = std::ptrdiff_t;

constexpr Shift kFarthest = 1000;  // rows: a farther shift is looked for in no batch
constexpr int kMostBlocks = 3;
constexpr std::size_t kLeastSteps = 3;  // of a block: fewer agree by chance

/// A block of rows [begin, end), whose joints stand `shift` rows later.
struct Block {
  std::size_t begin = 0, end = 0;
  Shift shift = 0;
  double gain = 0;  ///< m
};

std::string place(Shift shift) {
  if (shift == 1) return "of the next row";
  if (shift == -1) return "of the row before";
  return shift > 0 ? fmt::format("of {} rows later", shift)
                   : fmt::format("of {} rows before", -shift);
}

/// Each row with the joints of the row that `joints_of` gives; rows without such joints are left
/// out.
Reading reread(std::string name, std::vector<std::optional<std::size_t>> joints_of) {
  return {std::move(name), "rows", true,
          [joints_of = std::move(joints_of)](const NumberTable& table) {
            std::vector<std::size_t> rows, joints;
            for (std::size_t i = 0; i < joints_of.size(); ++i) {
              if (!joints_of[i]) continue;
              rows.push_back(i);
              joints.push_back(*joints_of[i]);
            }
            return matched(table, rows, joints);
          }};
}

class Rows {
 public:
  Rows(const NumberTable& table, const Cell& cell)
      : table_(table), n_(table.size()), joints_of_(n_) {
    for (std::size_t i = 0; i < n_; ++i) joints_of_[i] = i;
    std::vector<Vector3> nominal;
    for (std::size_t i = 0; i < n_; ++i) {
      const auto& X_FT = cell.tools.at(table.from[i]->context.tool);
      nominal.push_back(cell.robot.flange_pose(table.joints(i)) *
                        (X_FT ? Vector3(X_FT->translation()) : Vector3(Vector3::Zero())));
    }
    for (std::size_t i = 0; i + 1 < n_; ++i) {
      measured_.push_back((table.position(i + 1) - table.position(i)).norm());
      nominal_.push_back((nominal[i + 1] - nominal[i]).norm());
    }
    expected_ = nominal_;
    if (!measured_.empty()) most_ = median(measured_);
  }

  std::vector<Reading> all() {
    std::vector<Reading> readings;
    for (const Shift shift : {1, -1, 2, -2}) readings.push_back(shifted(shift));
    std::vector<std::optional<std::size_t>> reversed(n_);
    for (std::size_t i = 0; i < n_; ++i) reversed[i] = n_ - 1 - i;
    readings.push_back(reread("with the joints in the reverse order of rows", std::move(reversed)));
    std::string name = "with the joints ";
    for (int k = 0; k < kMostBlocks; ++k) {
      const auto block = best();
      if (!block) break;
      if (k == 0 && std::abs(block->shift) > 2 && 10 * (block->end - block->begin) > 8 * n_)
        readings.push_back(shifted(block->shift));
      take(*block);
      name += fmt::format("{}{} in rows {} to {}", k == 0 ? "" : " and ", place(block->shift),
                          table_.from[block->begin]->row, table_.from[block->end - 1]->row);
      readings.push_back(reread(name, joints_of_));
    }
    return readings;
  }

 private:
  [[nodiscard]] Reading shifted(Shift shift) const {
    std::vector<std::optional<std::size_t>> joints_of(n_);
    for (std::size_t i = 0; i < n_; ++i) joints_of[i] = at(i, shift, n_);
    return reread("with the joints " + place(shift), std::move(joints_of));
  }
  /// The row `shift` rows later, if it is within [0, count).
  static std::optional<std::size_t> at(std::size_t row, Shift shift, std::size_t count) {
    const Shift place = static_cast<Shift>(row) + shift;
    if (place < 0 || place >= static_cast<Shift>(count)) return std::nullopt;
    return static_cast<std::size_t>(place);
  }
  [[nodiscard]] double gain(std::size_t step, Shift shift) const {
    const auto there = at(step, shift, nominal_.size());
    if (!there) return -most_;
    return std::clamp(
        std::abs(measured_[step] - expected_[step]) - std::abs(measured_[step] - nominal_[*there]),
        -most_, most_);
  }
  /// The block whose distances gain most by one shift.
  [[nodiscard]] std::optional<Block> best() const {
    Block best;
    const Shift farthest = std::min<Shift>(kFarthest, static_cast<Shift>(nominal_.size()) - 1);
    for (Shift shift = -farthest; shift <= farthest; ++shift) {
      if (shift == 0) continue;
      double sum = 0;
      std::size_t begin = 0;
      for (std::size_t step = 0; step < measured_.size(); ++step) {
        if (sum <= 0) sum = 0, begin = step;
        sum += gain(step, shift);
        if (sum > best.gain && step + 1 - begin >= kLeastSteps)
          best = {begin, step + 2, shift, sum};
      }
    }
    if (best.gain == 0) return std::nullopt;
    return best;
  }
  void take(const Block& block) {
    for (std::size_t i = block.begin; i < block.end; ++i) joints_of_[i] = at(i, block.shift, n_);
    for (std::size_t step = block.begin; step + 1 < block.end; ++step) {
      if (const auto there = at(step, block.shift, nominal_.size()))
        expected_[step] = nominal_[*there];
    }
  }

  const NumberTable& table_;
  const std::size_t n_;
  std::vector<double> measured_, nominal_;  // m, from each row to the next
  std::vector<double> expected_;            // the expected distances, with the blocks taken so far
  double most_ = 0;                         // largest contribution of one step
  std::vector<std::optional<std::size_t>> joints_of_;
};

}  // namespace

std::vector<Reading> row_readings(const NumberTable& table, const Cell& cell) {
  return Rows(table, cell).all();
}

}  // namespace trammel::reading
