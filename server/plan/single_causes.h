#pragma once

#include <Eigen/Dense>
#include <optional>
#include <string>
#include <vector>

#include "server/error_sources/physical_model.h"

/// The effect on the tool of each single cause that may have changed.
namespace trammel {

/// A cause of the arm, its load or its tool that may have changed.
struct SingleCause {
  const CauseRecord* record = nullptr;  ///< of the catalogue
  int joint = -1;                       ///< 0-based; -1 where it concerns the whole arm
  std::string parameter = {};           ///< `d6` if one number of the cause is meant; else empty
  bool any_function = false;  ///< an error of the joint's angle by any function of that angle
};
/// `joint_slip:2`, `geometry:d6`.
[[nodiscard]] std::string to_string(const SingleCause& cause);
/// For people: `lost zero in joint 2`, `link geometry (d6)`.
[[nodiscard]] std::string in_words(const SingleCause& cause);
[[nodiscard]] bool same_cause(const SingleCause& one, const SingleCause& other);

/// A cause that cannot be tested, and the quantity that a record would need.
struct CauseNotAsked {
  SingleCause cause;
  std::string needs;
};

/// At one pose, all in B: m and rad of the tool.
struct PoseEffects {
  Pose X_BT = Pose::Identity();  ///< by the model's physics
  Eigen::MatrixXd by_cause;  ///< 6 x K, by each number of the causes, in units of its prior scale
  Eigen::Matrix<double, 6, 6> by_base;  ///< by a motion of the base
};

/// All single causes of a model's arm, one by one. Immutable, thread-safe.
class CauseEffects {
 public:
  struct Entry {
    SingleCause cause;
    std::vector<Eigen::Index>
        columns;  ///< of PoseEffects::by_cause; for "any function" the one of the joint's zero
  };
  /// The causes that `poses` could show with their recorded quantities; others are listed as not
  /// tested. `learned_at`, degrees Celsius: the temperature at which the model knows the arm's
  /// lengths; heat shows by the difference. Empty: only differences between the poses count.
  /// Without any difference, an arm that grew as a whole is still tested, since its temperature may
  /// not have been recorded.
  CauseEffects(PhysicalModel model, const std::vector<PoseContext>& poses,
               std::optional<double> learned_at = {});

  [[nodiscard]] const std::vector<Entry>& causes() const { return causes_; }
  [[nodiscard]] const std::vector<CauseNotAsked>& not_asked() const { return not_asked_; }
  /// The columns of a tool that sits elsewhere on the flange.
  [[nodiscard]] const std::vector<Eigen::Index>& tool_columns() const { return tool_; }
  /// Number of columns, K.
  [[nodiscard]] Eigen::Index size() const { return static_cast<Eigen::Index>(numbers_.size()); }
  /// The prior scale of a column, SI.
  [[nodiscard]] double scale(Eigen::Index column) const { return scale_(column); }
  /// At the values of the model.
  [[nodiscard]] PoseEffects at(const PoseContext& context) const;
  /// The effects where the causes have these numbers (K, in units of their prior scales).
  [[nodiscard]] PoseEffects at(const PoseContext& context, const Eigen::VectorXd& numbers) const;
  /// at() with the columns of warmth set to 0: a third of the work if no temperature is recorded.
  [[nodiscard]] PoseEffects without_warmth(const PoseContext& context,
                                           const Eigen::VectorXd& numbers) const;

 private:
  /// One number of a source, which gets a column.
  struct Number {
    std::string source;
    Eigen::Index number = 0;
  };
  void add(const CauseRecord& record, int joint);
  void add_numbers(const CauseRecord& record, int joint, const ErrorSource& source);
  void ask(SingleCause cause, const std::string& source, const std::vector<Eigen::Index>& numbers);
  /// The source of that cause in the model, added if the model lacks it; null if the cell cannot
  /// have it.
  [[nodiscard]] ErrorSourcePtr source_of(const CauseRecord& record, int joint);
  void find_places();
  /// The values of the model when the causes have these numbers.
  [[nodiscard]] Eigen::VectorXd values_at(const Eigen::VectorXd& numbers) const;
  [[nodiscard]] Eigen::MatrixXd jacobian_at(const PoseContext& context,
                                            const Eigen::VectorXd& values, Pose* X_WT) const;
  /// 6 x W: the columns of warmth.
  [[nodiscard]] Eigen::MatrixXd by_warmth(const PoseContext& context,
                                          const Eigen::VectorXd& values) const;
  [[nodiscard]] PoseEffects in_base(const Pose& X_WT, const Eigen::MatrixXd& jacobian_W) const;

  PhysicalModel model_;
  std::optional<double> learned_at_;
  bool is_warmth_recorded_ = false;
  std::vector<Entry> causes_;
  std::vector<CauseNotAsked> not_asked_;
  std::vector<Number> numbers_;      // of each column
  std::vector<Eigen::Index> place_;  // of each column among the model's parameters
  Eigen::VectorXd scale_;            // likewise
  std::vector<Eigen::Index> tool_;
  std::vector<Eigen::Index> warm_;  // columns of causes that depend on the temperature
};

}  // namespace trammel
