#include "server/calibrate/orientation_check.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <vector>

#include "server/base/median.h"
#include "server/base/units.h"
#include "server/calibrate/calibration.h"
#include "server/calibrate/frames/localisation.h"
#include "server/calibrate/orientation_readings.h"
#include "server/measurement/sessions.h"
#include "server/robot/rigid_fit.h"

namespace trammel {

namespace {

using orientations::angle;
using orientations::angles;
using orientations::common;
using orientations::kMostOff;
using orientations::nearer;
using orientations::Oriented;
using orientations::Quaternion;
using orientations::Quaternions;
using orientations::Reading;

// Angles, rms of all poses or of one pose.
constexpr double kWorthAsking =
    from_deg(0.2);  // below it one way of reading cannot be told from another
constexpr double kMuchBetter =
    0.25;                      // of the rms as given: another way of reading that was surely meant
constexpr double kFarRow = 5;  // times the median of all poses: a row of another pose
// Positions.
constexpr double kTellingSpread =
    20;  // spread over residual: the base's direction is then known to 3 degrees
constexpr double kBadPosition = 6;  // times the median residual: a pose that is wrong as a whole
constexpr double kMostBadPositions = 0.1;  // share of all positions: if more are bad, they are no
                                           // outliers, and all stay
// Numbers of poses.
constexpr std::size_t kFewestOriented =
    3;  // of a tool: two orientations agree with too many readings
constexpr std::size_t kMostPositions =
    300;  // evenly drawn beyond: more do not make the base more certain

double rms(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value * value;
  return std::sqrt(sum / static_cast<double>(values.size()));
}

/// Some of the poses: positions as measured, and the nominal flange.
struct Positions {
  Eigen::Matrix3Xd p_W;
  std::vector<Pose> X_BF;
};

/// The direction of the base.
struct Turned {
  Quaternion q_WB;
  std::vector<bool> bad;  ///< rows whose position is bad, too
};

double spread_across(const Eigen::Matrix3Xd& p) {
  const Eigen::Matrix3Xd centred = p.colwise() - p.rowwise().mean();
  const Vector3 singular =
      Eigen::JacobiSVD<Matrix3>(centred * centred.transpose()).singularValues();
  return std::sqrt(singular(1) / static_cast<double>(p.cols()));
}

double spread(const Eigen::Matrix3Xd& p) {
  return std::sqrt((p.colwise() - p.rowwise().mean()).squaredNorm() /
                   static_cast<double>(p.cols()));
}

Positions positions_of(const Oriented& group) {
  const std::size_t n = group.rows.size();
  const std::size_t count = std::min(n, kMostPositions);
  Positions some{Eigen::Matrix3Xd(3, static_cast<Eigen::Index>(count)), {}};
  for (std::size_t k = 0; k < count; ++k) {
    some.p_W.col(static_cast<Eigen::Index>(k)) = group.rows[k * n / count]->p_W;
    some.X_BF.push_back(group.X_BF[k * n / count]);
  }
  return some;
}

/// Base and tool point by the positions alone.
Result<BaseAndTool> located(const Positions& positions, const std::optional<Pose>& X_FT) {
  if (!X_FT) return locate_base_and_tool_point(positions.p_W, positions.X_BF);
  Eigen::Matrix3Xd p_B(3, positions.p_W.cols());
  for (std::size_t i = 0; i < positions.X_BF.size(); ++i)
    p_B.col(static_cast<Eigen::Index>(i)) = positions.X_BF[i] * X_FT->translation();
  const Pose X_WB = TRY(fit_transform(positions.p_W, p_B));
  return BaseAndTool{X_WB, *X_FT};
}

/// The base by the positions; `belong` is true if the positions belong to these joints.
struct Located {
  std::optional<Turned> turned;
  bool belong = true;
};
Located by_positions(const Oriented& group, const std::optional<Pose>& X_FT) {
  const Positions positions = positions_of(group);
  const Result<BaseAndTool> found = located(positions, X_FT);
  if (!found) return {};
  std::vector<double> off;
  for (std::size_t i = 0; i < group.rows.size(); ++i)
    off.push_back(
        (found->X_WB * (group.X_BF[i] * found->X_FT.translation()) - group.rows[i]->p_W).norm());
  const double typical = median(off);
  if (typical > std::max(kNoModelError, kNoModelShare * spread(positions.p_W)))
    return {std::nullopt, false};
  if (typical * kTellingSpread > spread_across(positions.p_W)) return {};
  Turned turned{Quaternion(found->X_WB.linear()), std::vector<bool>(off.size(), false)};
  const double limit = std::max(kNoModelError, kBadPosition * typical);
  for (std::size_t i = 0; i < off.size(); ++i) turned.bad[i] = off[i] > limit;
  const auto bad = static_cast<double>(std::count(turned.bad.begin(), turned.bad.end(), true));
  if (bad > kMostBadPositions * static_cast<double>(off.size()))
    turned.bad.assign(off.size(), false);
  return {turned, true};
}
/// The fit of one way of reading, alone or together with the numbers as given.
struct Judged {
  Quaternion q_FT = Quaternion::Identity();  ///< the rotation that the poses have in common
  std::vector<double> off;  ///< rad, of each pose: from the cell's tool, or from q_FT
  double scatter = 0;       ///< rad rms about q_FT
  double offset = 0;        ///< rad, of q_FT from the cell's tool; 0 where that is unknown
  double fit = 0;           ///< rad rms of both
};

Judged judged(const Quaternions& one, const Quaternions& other, const std::optional<Pose>& X_FT) {
  Judged result;
  result.q_FT = common(one, other);
  result.scatter = rms(nearer(one, other, result.q_FT));
  const Quaternion about = X_FT ? Quaternion(X_FT->linear()) : result.q_FT;
  result.offset = angle(about, result.q_FT);
  result.off = nearer(one, other, about);
  result.fit = rms(result.off);
  return result;
}

std::string deg(double radians) {
  return fmt::format("{:.{}f} deg", to_deg(radians), radians < from_deg(10) ? 2 : 0);
}

/// Asks whether the orientations of one tool follow the joints, for one rotation of the base.
class Question {
 public:
  Question(const Oriented& group, const Quaternion& q_WB, const Cell& cell)
      : group_(group),
        X_FT_(cell.tools.at(group.tool)),
        all_(orientations::readings(group, q_WB, cell.robot)) {
    const Quaternions& given = all_.front().q_FT;
    given_ = judged(given, given, X_FT_);
    if (follow()) return;
    for (std::size_t k = 1; k < all_.size(); ++k) {
      const Judged other = judged(all_[k].q_FT, all_[k].second(), X_FT_);
      if (best_ == 0 || other.fit < of_best_.fit) best_ = k, of_best_ = other;
    }
    look_for_two_orders();
  }
  double fit() const { return given_.fit; }

  std::optional<Error> doubt() const {
    if (follow()) return std::nullopt;
    const bool better = of_best_.fit < kMuchBetter * given_.fit && by_order();
    const bool one_fits_all =
        of_best_.fit < kMuchBetter * given_.fit && of_best_.fit < of_both_.fit;
    if (two_orders_ > 0 && !better && !one_fits_all) return of_two_orders();
    const std::vector<std::size_t> far = far_rows();
    if (given_.scatter <= kMostOff && given_.offset <= kMostOff && far.empty() && !better)
      return std::nullopt;
    if (given_.scatter <= kMostOff && far.empty() && given_.offset > kMostOff && !reads_better())
      return of_tool();
    if (!better && !far.empty() && 2 * far.size() < group_.rows.size() &&
        given_.offset <= kMostOff && !reads_better())
      return of_rows(far);
    return doubted(fmt::format("orientations do not follow the joints: {} rms; {}", deg(given_.fit),
                               otherwise()),
                   given_.fit)
        .with_text(reads_better() ? all_[best_].name : "")
        .next(reads_better() && !all_[best_].remedy.empty() ? all_[best_].remedy
                                                            : "xyzw order? another tool frame?")
        .value();
  }

 private:
  static Failure doubted(const std::string& what, double off) {
    return refused("{}", what).of("qw,qx,qy,qz").beyond(to_deg(off), to_deg(kMostOff));
  }
  /// True if the orientations fit so well that no other reading needs a try.
  bool follow() const { return given_.fit <= kWorthAsking && far_rows().empty(); }
  bool by_order() const { return all_[best_].by_order; }
  bool reads_better() const { return of_best_.fit < std::min(kMostOff, 0.5 * given_.fit); }

  void look_for_two_orders() {
    for (std::size_t k = 1; k < all_.size() && all_[k].by_order; ++k) {
      const Judged both = judged(all_.front().q_FT, all_[k].q_FT, X_FT_);
      if (both.fit > std::min(kMostOff, kMuchBetter * given_.fit)) continue;
      if (two_orders_ == 0 || both.fit < of_both_.fit) two_orders_ = k, of_both_ = both;
    }
  }
  /// Rows far from the common rotation of the others.
  std::vector<std::size_t> far_rows() const {
    const std::vector<double> off = angles(all_.front().q_FT, given_.q_FT);
    const double limit = std::max(kMostOff, kFarRow * median(off));
    std::vector<std::size_t> far;
    for (std::size_t i = 0; i < off.size(); ++i) {
      if (off[i] > limit) far.push_back(i);
    }
    return far;
  }
  std::string otherwise() const {
    if (reads_better())
      return fmt::format("read {} they would fit to {}", all_[best_].name, deg(of_best_.fit));
    return fmt::format("no other reading fits either (best: {}, {})", all_[best_].name,
                       deg(of_best_.fit));
  }
  Error of_two_orders() const {
    const Quaternion about = X_FT_ ? Quaternion(X_FT_->linear()) : of_both_.q_FT;
    std::vector<double> off;
    int first = 0;
    for (std::size_t i = 0; i < group_.rows.size(); ++i) {
      const double as_given = angle(all_.front().q_FT[i], about);
      if (as_given <= angle(all_[two_orders_].q_FT[i], about) + of_both_.fit) continue;
      if (off.empty()) first = group_.rows[i]->row;
      off.push_back(as_given);
    }
    const double far = off.empty() ? given_.fit : rms(off);
    return doubted(fmt::format("the first of {} of {} orientations that do not follow the joints: "
                               "{} rms; read {} they would fit to {}, as the others do",
                               off.size(), group_.rows.size(), deg(far), all_[two_orders_].name,
                               deg(of_both_.fit)),
                   far)
        .at_row(first)
        .with_text(all_[two_orders_].name)
        .next("two files of different order in one? xyzw order? another tool frame?")
        .value();
  }
  Error of_tool() const {
    const Quaternion q = given_.q_FT.w() < 0 ? Quaternion(-given_.q_FT.coeffs()) : given_.q_FT;
    return doubted(fmt::format("orientations follow the joints to {}, but turned by {} against "
                               "tool '{}' of the cell file; {}",
                               deg(given_.scatter), deg(given_.offset), group_.tool, otherwise()),
                   given_.offset)
        .with_text(fmt::format("against tool '{}'", group_.tool))
        .next(fmt::format(
            "another tool frame? xyzw order? Its q_wxyz would be [{:.4f}, {:.4f}, {:.4f}, {:.4f}]",
            q.w(), q.x(), q.y(), q.z()))
        .value();
  }
  Error of_rows(const std::vector<std::size_t>& far) const {
    std::vector<double> off;
    for (const std::size_t i : far) off.push_back(angle(all_.front().q_FT[i], given_.q_FT));
    const Measurement& first = *group_.rows[far.front()];
    return doubted(fmt::format("pose {} is the first of {} of {} orientations that do not follow "
                               "the joints: {} rms, the others {}",
                               first.pose_id, far.size(), group_.rows.size(), deg(rms(off)),
                               deg(median(angles(all_.front().q_FT, given_.q_FT)))),
                   rms(off))
        .at_row(first.row)
        .with_text("pose " + first.pose_id)
        .next("xyzw order? another tool frame? the joints of another pose?")
        .value();
  }

  const Oriented& group_;
  const std::optional<Pose>& X_FT_;
  std::vector<Reading> all_;
  Judged given_, of_best_, of_both_;
  std::size_t best_ = 0;
  std::size_t two_orders_ = 0;  // a reading of some rows only; 0: none
};

/// Doubts orientations that are equal in all rows although the flange turns: they were not
/// measured.
std::optional<Error> doubt_of_same(const Oriented& group) {
  double turned = 0;
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    if (*group.rows[i]->R_WT != *group.rows.front()->R_WT) return std::nullopt;
    turned = std::max(
        turned, angle(Quaternion(group.X_BF[i].linear()), Quaternion(group.X_BF.front().linear())));
  }
  if (turned < kMostOff) return std::nullopt;
  return refused("all {} orientations are the same, while the joints turn the flange by up to {}",
                 group.rows.size(), deg(turned))
      .of("qw,qx,qy,qz")
      .at_row(group.rows.front()->row)
      .beyond(0, to_deg(kMostOff))
      .with_text("the same in all rows")
      .next("were they not measured? Then leave their columns out")
      .value();
}

/// The poses of each tool that have an orientation.
std::vector<Oriented> by_tool(const MeasurementBatch& batch, const Chain& robot) {
  std::map<std::string, Oriented> groups;
  for (const Measurement& m : batch.measurements) {
    if (!m.R_WT) continue;
    Oriented& group = groups[m.context.tool];
    group.tool = m.context.tool;
    group.rows.push_back(&m);
    group.X_BF.push_back(robot.flange_pose(m.context.q));
  }
  std::vector<Oriented> all;
  for (auto& [tool, group] : groups) {
    if (group.rows.size() >= kFewestOriented) all.push_back(std::move(group));
  }
  return all;
}

Oriented without(const Oriented& group, const std::vector<bool>& bad) {
  Oriented kept{group.tool, {}, {}};
  for (std::size_t i = 0; i < group.rows.size(); ++i) {
    if (bad[i]) continue;
    kept.rows.push_back(group.rows[i]);
    kept.X_BF.push_back(group.X_BF[i]);
  }
  return kept;
}

/// The base's rotation by the orientations alone, if nothing else determines it.
std::optional<Quaternion> by_orientations(const Oriented& group) {
  std::vector<Pose> X_WT;
  for (const Measurement* m : group.rows) X_WT.push_back(make_pose(*m->R_WT, m->p_W));
  const Result<BaseAndTool> found = locate_base_and_tool(X_WT, group.X_BF);
  if (!found) return std::nullopt;
  return Quaternion(found->X_WB.linear());
}

/// True if the positions fit a base at `X_WB` within the model error of a robot.
bool stands_at(const Pose& X_WB, const std::optional<Pose>& X_FT, const Oriented& group) {
  const Positions positions = positions_of(group);
  Eigen::Matrix3Xd p_F(3, positions.p_W.cols());
  for (Eigen::Index i = 0; i < p_F.cols(); ++i)
    p_F.col(i) = positions.X_BF[static_cast<std::size_t>(i)].inverse() *
                 (X_WB.inverse() * positions.p_W.col(i));
  const Vector3 p_FT = X_FT ? Vector3(X_FT->translation()) : Vector3(p_F.rowwise().mean());
  std::vector<double> off;
  for (Eigen::Index i = 0; i < p_F.cols(); ++i) off.push_back((p_F.col(i) - p_FT).norm());
  return median(off) <= kNoModelError;
}

std::optional<Error> doubt_of(Oriented group, const Cell& cell, const std::optional<Pose>& X_WB) {
  const std::optional<Pose>& X_FT = cell.tools.at(group.tool);
  if (auto same = doubt_of_same(group)) return same;
  if (X_WB) return Question(group, Quaternion(X_WB->linear()), cell).doubt();
  const Located located = by_positions(group, X_FT);
  if (!located.belong) return std::nullopt;  // the joints themselves are in question
  std::vector<Quaternion> turned;
  if (located.turned) {
    turned.push_back(located.turned->q_WB);
    group = without(group, located.turned->bad);
  }
  // The base of the cell file is more exact, unless the tracker stands elsewhere now.
  const auto base = cell.X_WB ? std::optional<Quaternion>(cell.X_WB->linear()) : std::nullopt;
  if (base && (turned.empty() || angle(*base, turned.front()) < kMostOff)) turned.push_back(*base);
  if (!located.turned && !(cell.X_WB && stands_at(*cell.X_WB, X_FT, group))) {
    if (const auto q_WB = by_orientations(group)) turned.push_back(*q_WB);
  }
  // The base under which the numbers as given fit best is the right one.
  std::optional<Question> best;
  for (const Quaternion& q_WB : turned) {
    Question question(group, q_WB, cell);
    if (!best || question.fit() < best->fit()) best.emplace(std::move(question));
  }
  return best ? best->doubt() : std::nullopt;
}

}  // namespace

std::optional<Error> orientation_doubt(const MeasurementBatch& batch, const Cell& cell,
                                       const std::optional<Pose>& X_WB) {
  for (const MeasurementBatch& session :
       by_session(batch)) {  // each was measured in a world of its own
    for (const Oriented& group : by_tool(session, cell.robot)) {
      if (auto doubt = doubt_of(group, cell, X_WB)) return doubt;
    }
  }
  return std::nullopt;
}

Status check_orientations(const MeasurementBatch& batch, const Cell& cell) {
  std::optional<Error> doubt = orientation_doubt(batch, cell);
  if (!doubt) return {};
  return Failure(std::move(*doubt)).in("batch " + batch.id);
}

}  // namespace trammel
