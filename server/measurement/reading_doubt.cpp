#include "server/measurement/reading_doubt.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/measurement/one_place.h"
#include "server/measurement/pose_columns.h"
#include "server/measurement/pose_groups.h"
#include "server/measurement/reading/arm_fit.h"
#include "server/measurement/reading/catalogue.h"
#include "server/measurement/reading/several_points.h"
#include "server/measurement/reading_units.h"

namespace trammel {

namespace {

using reading::ArmFit;
using reading::NumberTable;
using reading::Reading;

constexpr std::size_t kFewestPoses = 6;
constexpr std::size_t kRowsLocated = 80, kRowsFitted = 200;  // evenly drawn beyond
constexpr std::size_t kMostFitted =
    16;  // readings that are tried with all of the arm, the nearest first
// Distances, m.
constexpr double kWorthAsking =
    1e-3;  // m: with a smaller misfit no reading is tried, since a robot's model error is as large
constexpr double kOfRows =
    5e-3;  // the same for rows: on a path, a late clock looks like the next row
constexpr double kMuchBetter = 0.25;  // share of the distance as given: below it the reading was
                                      // surely meant
constexpr double kAsGood = 1.5;  // times the best misfit: readings below it cannot be distinguished
constexpr double kFollow =
    20e-3;  // m: below this misfit, single rows, zeros and tools are examined
constexpr double kBadRow = 10e-3;  // and 8 times the median: a row of other joints
constexpr double kBadRowRatio = 8;
constexpr std::size_t kFewestBadRows = 3;
constexpr double kFixedPoint = 1e-3;   // spread of a tip's places on a spike
constexpr double kSamePlace = 1e-6;    // likewise, for positions that were not measured
constexpr double kOtherPlace = 50e-3;  // m: a base farther from the cell file's stands at another
                                       // place
// A larger zero error than any robot has.
constexpr double kMostZero = from_deg(15);
constexpr double kCertainZero = from_deg(4);  // its standard deviation is below that
constexpr double kCertainBase = from_deg(1);
constexpr double kToolStddev = 5e-3;  // of a mounted tool
constexpr double kToolSigmas = 4;
constexpr double kSameTool = 0.4;  // share of the distance: another tool of the cell that is this
                                   // near
// Stated uncertainties.
constexpr std::size_t kFewestForSigma = 20;  // poses: below that an arm follows noise
constexpr double kNotThatGood =
    0.25;  // share of the stated deviation: honest noise leaves at least 0.8 of it
constexpr double kHarmless = 3e-4;  // m: who states less may be careful, and does no harm
// Angles.
constexpr double kOtherTurn = from_deg(0.5);  // a larger difference in turn lets orientations
                                              // decide between readings
constexpr double kNearBase = from_deg(30);    // a base near its place in the cell file

std::string mm(double metres) {
  const double value = to_mm(metres);
  return fmt::format("{:.{}f} mm", value, value < 1 ? 2 : value < 100 ? 1 : 0);
}

/// A reading that was tried with all of the arm.
struct Tried {
  const Reading* reading = nullptr;
  NumberTable table;
  ArmFit fit;
};

/// rad: the median turn between the measured orientations and those of the arm with its tool; empty
/// if there are none.
std::optional<double> turned(const NumberTable& table, const Cell& cell, const ArmFit& fit) {
  std::map<std::string, std::vector<Matrix3>> by_tool;
  for (std::size_t i = 0; i < table.size(); ++i) {
    if (table.R_WT[i])
      by_tool[table.from[i]->context.tool].push_back(
          flange_pose_W(table, i, cell, fit).linear().transpose() * *table.R_WT[i]);
  }
  std::vector<double> off;
  for (const auto& [tool, all] : by_tool) {
    Matrix3 sum = Matrix3::Zero();
    for (const Matrix3& R_FT : all) sum += R_FT;
    const auto& X_FT = cell.tools.at(tool);
    const Eigen::Quaterniond about(X_FT ? Matrix3(X_FT->linear()) : nearest_rotation(sum));
    for (const Matrix3& R_FT : all) off.push_back(about.angularDistance(Eigen::Quaterniond(R_FT)));
  }
  if (off.empty()) return std::nullopt;
  return median(off);
}

class Look {
 public:
  Look(const MeasurementBatch& batch, const Cell& cell)
      : cell_(cell), table_(reading::table_of(batch)) {
    if (table_.size() < kFewestPoses) return;
    const NumberTable some = thinned(table_, kRowsFitted);
    const ArmFit drawn = located(thinned(table_, kRowsLocated), cell_);
    off_drawing_ = drawn.off;
    given_ = fitted(some, cell_, drawn);
    if (given_->quality > kWorthAsking && are_at_one_place(table_.p_W))
      given_ = fitted_from_all_sides(some, cell_, *given_);
  }

  ReadingLook look() {
    ReadingLook seen;
    seen.zeros = JointVector::Zero(cell_.robot.size());
    seen.off_drawing = off_drawing_;
    if (!given_) return seen;
    seen.doubt = reading::doubt_of_several_points(table_);
    if (seen.doubt) return seen;
    seen.doubt = of_place();
    seen.of_tool = seen.doubt.has_value();
    if (seen.doubt) return seen;
    if (given_->quality > kWorthAsking) {
      search();
      if (!found_.empty()) {
        seen.doubt = of_reading();
        return seen;
      }
    }
    if (given_->off > kFollow) {
      if (anywhere().quality < kMuchBetter * given_->quality) seen.doubt = of_tool();
      seen.of_tool = seen.doubt.has_value();
      return seen;
    }
    seen.zeros = given_->arm.head(cell_.robot.size());
    if (given_->base_turn_stddev < kCertainBase) seen.X_WB = given_->X_WB;
    seen.doubt = of_units();
    if (!seen.doubt) seen.doubt = of_some_rows();
    if (!seen.doubt) seen.doubt = of_zero();
    if (!seen.doubt) seen.doubt = of_sigma();
    if (seen.doubt) return seen;
    seen.doubt = of_tool();
    seen.of_tool = seen.doubt.has_value();
    return seen;
  }

 private:
  void search();
  [[nodiscard]] bool is_much_better(const Tried& tried) const;
  [[nodiscard]] const ArmFit& anywhere();
  void keep_best(std::vector<Tried> tried);
  [[nodiscard]] std::optional<Error> of_place() const;
  [[nodiscard]] Error of_reading() const;
  [[nodiscard]] std::optional<Error> of_units() const;
  [[nodiscard]] std::optional<Error> of_some_rows();
  [[nodiscard]] std::optional<Error> of_zero() const;
  [[nodiscard]] std::optional<Error> of_sigma() const;
  [[nodiscard]] std::optional<Error> of_tool();
  [[nodiscard]] Error of_tool_at(const std::string& tool, const Vector3& p_FT) const;

  /// The cell with the robot as the reading has it.
  [[nodiscard]] Cell cell_of(const Reading& reading) const {
    Cell cell = cell_;
    if (reading.robot) cell.robot = *reading.robot;
    return cell;
  }

  const Cell& cell_;
  const NumberTable table_;
  std::optional<ArmFit> given_, anywhere_;
  double off_drawing_ = -1;
  std::vector<Reading> readings_;
  std::vector<Tried> found_;  // readings that fit and cannot be separated, the most likely first
};

void Look::search() {
  const NumberTable few = thinned(table_, kRowsLocated);
  const NumberTable some = thinned(table_, kRowsFitted);
  readings_ = position_readings(table_);
  for (auto& one : joint_readings(table_, cell_.robot)) readings_.push_back(std::move(one));
  for (auto& one : row_readings(table_, cell_)) readings_.push_back(std::move(one));
  for (auto& one : reading::robot_readings(cell_.robot)) readings_.push_back(std::move(one));
  std::vector<std::pair<double, Tried>> near;
  for (const Reading& one : readings_) {
    Tried tried{&one, one.of_rows ? thinned(one.apply(table_), kRowsFitted) : one.apply(some), {}};
    if (tried.table.size() < kFewestPoses) continue;
    tried.fit =
        located(one.of_rows ? thinned(tried.table, kRowsLocated) : one.apply(few), cell_of(one));
    const double quality = tried.fit.quality;
    near.emplace_back(quality, std::move(tried));
  }
  std::stable_sort(near.begin(), near.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  if (near.size() > kMostFitted) near.resize(kMostFitted);
  std::vector<Tried> tried;
  for (auto& [quality, one] : near) {
    one.fit = fitted(one.table, cell_of(*one.reading), one.fit);
    const bool worth = !one.reading->of_rows || given_->quality > kOfRows;
    if (worth && is_much_better(one)) tried.push_back(std::move(one));
  }
  const auto fits_best = [](const Tried& a, const Tried& b) {
    return a.fit.quality < b.fit.quality;
  };
  const auto best = std::min_element(tried.begin(), tried.end(), fits_best);
  if (best == tried.end()) return;
  // A wrong zero or sign of a joint may partly compensate a wrong tool point.
  const bool is_rather_the_tool =
      kAsGood * anywhere().quality + 0.2 * kWorthAsking < best->fit.quality;
  if (!is_rather_the_tool) keep_best(std::move(tried));
}

/// The arm with the points of its tools wherever they fit best.
const ArmFit& Look::anywhere() {
  if (anywhere_) return *anywhere_;
  using reading::ToolPoints;
  const NumberTable some = thinned(table_, kRowsFitted);
  const ArmFit start = located(thinned(table_, kRowsLocated), cell_, ToolPoints::kAnywhere);
  anywhere_ = fitted(some, cell_, start, ToolPoints::kAnywhere);
  ArmFit near = fitted(some, cell_, *given_, ToolPoints::kAnywhere);
  if (near.quality < anywhere_->quality) anywhere_ = std::move(near);
  return *anywhere_;
}

/// True if the reading fits much better relative to the spread of its positions. A reading that
/// shrinks the positions also shrinks their misfit.
bool Look::is_much_better(const Tried& tried) const {
  const double as_given = spread_of(table_.p_W);
  return tried.fit.quality < kFollow &&
         tried.fit.quality * as_given <
             kMuchBetter * given_->quality * std::min(as_given, spread_of(tried.table.p_W));
}

/// Keeps the best of readings that fit the positions as well: orientations decide, then where the
/// base stands, then the catalogue.
void Look::keep_best(std::vector<Tried> tried) {
  const auto keep = [&tried](const auto& figure, double ratio, double slack, double limit) {
    std::vector<double> all;
    for (const Tried& one : tried) all.push_back(figure(one));
    const double least = *std::min_element(all.begin(), all.end());
    if (least > limit) return;
    std::vector<Tried> kept;
    for (std::size_t i = 0; i < tried.size(); ++i) {
      if (all[i] <= ratio * least + slack) kept.push_back(std::move(tried[i]));
    }
    tried = std::move(kept);
  };
  const auto quality = [](const Tried& one) { return one.fit.quality; };
  keep(quality, kAsGood, 0.2 * kWorthAsking, std::numeric_limits<double>::infinity());
  keep(
      [this](const Tried& one) {
        return turned(one.table, cell_of(*one.reading), one.fit).value_or(0);
      },
      kAsGood, kOtherTurn, kPi);
  std::stable_sort(tried.begin(), tried.end(),
                   [](const Tried& a, const Tried& b) { return a.reading < b.reading; });
  if (cell_.X_WB) {
    const auto from_drawn = [this](const Tried& one) {
      return Eigen::Quaterniond(one.fit.X_WB.linear())
          .angularDistance(Eigen::Quaterniond(cell_.X_WB->linear()));
    };
    std::vector<Tried> all = tried;
    keep(from_drawn, 1, from_deg(5), kNearBase);
    const Reading* first = tried.front().reading;
    std::stable_partition(all.begin(), all.end(),
                          [first](const Tried& one) { return one.reading == first; });
    tried = std::move(all);
  }
  found_ = std::move(tried);
}

/// Doubts positions at one fixed point that the cell's base contradicts. They do not determine
/// another base, and a fit would bend the arm until it reached the point.
std::optional<Error> Look::of_place() const {
  const bool tools_known = std::all_of(table_.from.begin(), table_.from.end(), [&](const auto* m) {
    return cell_.tools.at(m->context.tool).has_value();
  });
  if (spread_of(table_.p_W) > kFixedPoint || (!cell_.X_WB && !tools_known)) return std::nullopt;
  if (pose_groups(table_.q.transpose()).size() < kFewestPoses) return std::nullopt;
  const Vector3 place = table_.p_W.rowwise().mean();
  const auto shown = [](const Vector3& p) {
    return fmt::format("[{:.1f}, {:.1f}, {:.1f}]", to_mm(p.x()), to_mm(p.y()), to_mm(p.z()));
  };
  if (!cell_.X_WB) {
    if (spread_of(table_.p_W) > kSamePlace) return std::nullopt;
    return refused("all positions are {} mm, and do not tell how the base is turned", shown(place))
        .of("x_mm,y_mm,z_mm")
        .with_text("one place")
        .next(
            "a tip on a fixed point tells the tool, where the cell file says null for it; give "
            "the base in the cell file, or measure at other places, too")
        .value();
  }
  const Vector3 drawn = *cell_.X_WB * (given_->X_WB.inverse() * place);
  const double away = (drawn - place).norm();
  if (given_->off > kFollow || away < kOtherPlace) return std::nullopt;
  return refused(
             "the positions are all at {} mm, and the joints lead to {} mm where the base stands "
             "as in the cell file, {} away",
             shown(place), shown(drawn), mm(away))
      .of("x_mm,y_mm,z_mm")
      .beyond(to_mm(away), to_mm(kOtherPlace))
      .with_text("another place")
      .next(
          "a fixed point whose place nobody measured? write base: null in the cell file, and null "
          "for the tool; else measure the point in the frame of the base")
      .value();
}

Error Look::of_reading() const {
  const Tried& best = found_.front();
  const double given = std::max(given_->off, given_->quality);
  std::string text =
      fmt::format("the positions do not follow the joints: {} off; read {} they would fit to {}",
                  mm(given), best.reading->name, mm(std::max(best.fit.off, best.fit.quality)));
  std::vector<std::string> others;
  for (std::size_t k = 1; k < found_.size(); ++k) {
    // Other readings of rows are the same with a few rows more.
    if (!best.reading->of_rows) others.push_back(found_[k].reading->name);
  }
  if (!best.reading->the_same.empty()) others.insert(others.begin(), best.reading->the_same);
  if (!others.empty()) {
    text += fmt::format(" (or {})", fmt::join(others, ", or "));
  }
  return refused("{}", text)
      .of(best.reading->columns)
      .beyond(to_mm(given), to_mm(std::max(kWorthAsking, kMuchBetter * given_->quality)))
      .with_text(best.reading->name)
      .next(best.reading->robot ? "is it such a table? models/README.md says how to write it here"
                                : "correct the file if it was meant so")
      .value();
}

/// Rows that are in another unit than the others.
std::optional<Error> Look::of_units() const {
  const std::vector<double> off = distances(table_, cell_, *given_);
  const double limit = std::max(kBadRow, kBadRowRatio * median(off));
  for (const UnitOfLength& unit : kUnitsOfLength) {
    NumberTable table = table_;
    table.p_W *= unit.factor;
    const std::vector<double> then = distances(table, cell_, *given_);
    std::vector<int> rows;
    double worst = 0, left = 0;
    for (std::size_t i = 0; i < off.size(); ++i) {
      if (off[i] <= limit || then[i] > limit) continue;
      rows.push_back(table_.from[i]->row);
      worst = std::max(worst, off[i]);
      left = std::max(left, then[i]);
    }
    if (rows.empty()) continue;
    const bool one = rows.size() == 1;
    return refused(
               "{} of {} positions {} not follow the joints, by up to {}: {} {}; read in {} {} "
               "would fit to {}",
               rows.size(), off.size(), one ? "does" : "do", mm(worst), one ? "row" : "rows",
               fmt::format("{}", fmt::join(rows, ", ")), unit.name, one ? "it" : "they", mm(left))
        .of("x_mm,y_mm,z_mm")
        .at_row(rows.front())
        .beyond(to_mm(worst), to_mm(limit))
        .with_text(fmt::format("in {}", unit.name))
        .next("write all rows in mm")
        .value();
  }
  return std::nullopt;
}

/// Doubts a block of rows whose joints belong to other rows, if the remaining rows are right.
std::optional<Error> Look::of_some_rows() {
  const std::vector<double> off = distances(table_, cell_, *given_);
  const double limit = std::max(kBadRow, kBadRowRatio * median(off));
  const auto bad = static_cast<std::size_t>(
      std::count_if(off.begin(), off.end(), [&](double d) { return d > limit; }));
  if (bad < kFewestBadRows) return std::nullopt;
  for (const Reading& one : row_readings(table_, cell_)) {
    const NumberTable table = one.apply(table_);
    if (2 * (table_.size() - table.size()) > bad) continue;
    const std::vector<double> then = distances(table, cell_, *given_);
    const auto left = static_cast<std::size_t>(
        std::count_if(then.begin(), then.end(), [&](double d) { return d > limit; }));
    if (4 * left > bad) continue;
    const auto first = std::find_if(off.begin(), off.end(), [&](double d) { return d > limit; });
    const double worst = *std::max_element(off.begin(), off.end());
    return refused(
               "{} of {} positions do not follow the joints, by up to {}; read {} all but {} would "
               "fit to {}",
               bad, off.size(), mm(worst), one.name, left, mm(median(then)))
        .of(one.columns)
        .at_row(table_.from[static_cast<std::size_t>(first - off.begin())]->row)
        .beyond(to_mm(worst), to_mm(limit))
        .with_text(one.name)
        .next("correct the file if it was meant so")
        .value();
  }
  return std::nullopt;
}

/// A joint that counts from another zero than the robot file's.
std::optional<Error> Look::of_zero() const {
  constexpr double kQuarter = 90;
  for (int j = 0; j < cell_.robot.size(); ++j) {
    const double zero = given_->arm(j);
    if (cell_.robot.joint(j).type != JointType::kRevolute || std::abs(zero) < kMostZero) continue;
    if (given_->stddev_of_zeros(j) > kCertainZero) continue;
    const double turns = kQuarter * std::round(to_deg(zero) / kQuarter);
    const bool is_turn = turns != 0 && std::abs(to_deg(zero) - turns) < to_deg(kMostZero);
    if (j + 1 == cell_.robot.size() && !is_turn)
      continue;  // the tool turned about the last axis, or another one
    const std::string column = joint_column(j, JointType::kRevolute);
    const double added = std::remainder(is_turn ? turns : to_deg(zero), 360);
    const std::string name = fmt::format("with {:.3g} deg added to {}", added, column);
    return refused(
               "the positions follow the joints only {}: the zero of joint {} would be {:.1f} deg "
               "from the robot file's",
               name, j + 1, added)
        .of(column)
        .beyond(std::abs(added), to_deg(kMostZero))
        .with_text(name)
        .next("another convention, or another robot?")
        .value();
  }
  return std::nullopt;
}

/// Doubts positions that are far more precise than stated: their deviations are in another unit.
std::optional<Error> Look::of_sigma() const {
  if (table_.size() < kFewestForSigma) return std::nullopt;
  std::vector<double> stated;
  for (const Measurement* m : table_.from) stated.push_back(m->sigma.value_or(cell_.tracker.sigma));
  const double sigma = median(stated);
  if (sigma < kHarmless || given_->off > kNotThatGood * sigma) return std::nullopt;
  return refused("the positions follow the joints to {}, and are said to be uncertain by {}",
                 mm(given_->off), mm(sigma))
      .of("sigma_mm")
      .beyond(to_mm(sigma), to_mm(given_->off / kNotThatGood))
      .next("is sigma_mm in another unit?")
      .value();
}

/// Doubts that the measured point is the tool's point.
std::optional<Error> Look::of_tool() {
  for (const auto& [tool, X_FT] : given_->tools) {
    const auto& drawn = cell_.tools.at(tool);
    if (!drawn || (X_FT.translation() - drawn->translation()).norm() < kToolStddev) continue;
    const Vector3 p_FT = anywhere().tools.at(tool).translation();
    const Vector3 moved = p_FT - drawn->translation();
    const Matrix3 spread =
        anywhere().tool_covariance.at(tool) + kToolStddev * kToolStddev * Matrix3::Identity();
    if (moved.dot(spread.ldlt().solve(moved)) > kToolSigmas * kToolSigmas)
      return of_tool_at(tool, p_FT);
  }
  return std::nullopt;
}

Error Look::of_tool_at(const std::string& tool, const Vector3& p_FT) const {
  const double moved = (p_FT - cell_.tools.at(tool)->translation()).norm();
  std::string is = "another point of the tool";
  for (const auto& [other, X_FT] : cell_.tools) {
    if (other != tool && X_FT && (p_FT - X_FT->translation()).norm() < kSameTool * moved)
      is = fmt::format("those of tool '{}'", other);
  }
  return refused("the positions are {} from the point of tool '{}': they would be {}", mm(moved),
                 tool, is)
      .of("tool_id")
      .beyond(to_mm(moved), to_mm(kToolSigmas * kToolStddev))
      .with_text(is)
      .next(fmt::format("another tool frame? Its xyz_mm would be [{:.1f}, {:.1f}, {:.1f}]",
                        to_mm(p_FT.x()), to_mm(p_FT.y()), to_mm(p_FT.z())))
      .value();
}

/// The batch with its tools named, if the cell knows them and the joints are as many as the
/// robot's.
std::optional<MeasurementBatch> with_tools(MeasurementBatch batch, const Cell& cell) {
  for (Measurement& m : batch.measurements) {
    const auto tool = resolve_tool(cell, m.context.tool);
    if (!tool || m.context.q.size() != cell.robot.size()) return std::nullopt;
    m.context.tool = *tool;
    if (const auto payload = resolve_payload(cell, m.context.payload)) m.context.payload = *payload;
  }
  return batch;
}

}  // namespace

ReadingLook look_at_readings(const MeasurementBatch& batch, const Cell& cell) {
  return Look(batch, cell).look();
}

Error with_likely_reading(Error failed, const MeasurementBatch& batch, const Cell& cell) {
  const auto named = with_tools(batch, cell);
  if (!named) return failed;
  const ReadingLook seen = look_at_readings(*named, cell);
  if (!seen.doubt || seen.of_tool) return failed;
  failed.text = seen.doubt->text;
  failed.next = seen.doubt->message;
  return failed;
}

}  // namespace trammel
