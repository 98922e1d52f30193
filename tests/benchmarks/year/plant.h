#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "server/measurement/measurement.h"
#include "server/simulate/simulate.h"

/// A year of a plant as it really is: arms of several makers, and what happens to them. Only
/// whoever keeps the score sees it; the service gets cell files and batches.
namespace trammel::year {

constexpr int kWeeks = 52;
constexpr double kWeek = 7 * 86400.0;  // s

/// Something that makes an arm another one.
struct Event {
  int week = 0;        ///< from which it acts; of a slow one, in which it begins
  std::string what;    ///< for people
  std::string source;  ///< whose parameters change
  std::vector<std::pair<std::string, double>> changes;  ///< parameters by how their names begin, SI
  std::vector<std::string> names;                       ///< causes that it may be called
  int joint = 0;                                        ///< 1-based; 0: of no single one
  bool slow = false;                                    ///< grows from week to week until the end
};

/// A cell file, its robot, and the arm that stands there.
class Arm {
 public:
  /// `model`: a file of models/ without its ending. What the arm is like and what happens to it
  /// follow from `seed`.
  Arm(const std::string& name, const std::string& model, double payload_kg, std::uint64_t seed);

  [[nodiscard]] const std::string& cell_yaml() const { return cell_yaml_; }
  [[nodiscard]] const std::shared_ptr<const Cell>& cell() const { return cell_; }
  [[nodiscard]] const std::vector<Event>& events() const { return events_; }
  /// True if something that happens at once happens in that week.
  [[nodiscard]] bool is_hit(int week) const;
  /// True if something slow is going on by then.
  [[nodiscard]] bool is_wearing(int week) const;
  [[nodiscard]] double temperature(int week) const;  ///< of the hall, degrees Celsius

  /// Joint vectors (rows, rad) that its programs use.
  [[nodiscard]] Eigen::MatrixXd poses(int count, std::uint64_t seed) const;
  /// The tool as it really is in that week, 3 x N, m, in the arm's true base.
  [[nodiscard]] Eigen::Matrix3Xd true_positions(const Eigen::MatrixXd& q, int week) const;
  /// What a tracker measures in that week. Where it is `set_up_anew` it stands elsewhere than ever
  /// before.
  [[nodiscard]] MeasurementBatch measured(const Eigen::MatrixXd& q, int week, std::uint64_t seed,
                                          bool set_up_anew) const;

 private:
  [[nodiscard]] VirtualRobot in_week(int week) const;
  [[nodiscard]] std::vector<PoseContext> contexts(const Eigen::MatrixXd& q, int week) const;

  std::string cell_yaml_;
  std::shared_ptr<const Cell> cell_;
  VirtualRobot robot_;  // new, in week 0
  std::vector<Event> events_;
};

/// Twelve arms of seven types.
[[nodiscard]] std::vector<Arm> plant(int cells, std::uint64_t seed);

/// A batch as it should never have been sent: in inches, of another arm, with rows that slipped by
/// one, with a tracker that was knocked, or five times as noisy.
struct BadBatch {
  std::string what;
  MeasurementBatch batch;
};
[[nodiscard]] BadBatch bad_batch(const Arm& arm, int week, int which, std::uint64_t seed);

}  // namespace trammel::year
