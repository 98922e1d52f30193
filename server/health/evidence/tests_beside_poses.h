#pragma once

#include <cstddef>
#include <vector>

#include "server/health/evidence/refitted_rows.h"

namespace trammel::health {

/// The view of the tests of a check once some of its poses are refitted as bad, found without
/// touching its R rows again.
///
/// Let D_h be the orthonormal directions of hypothesis h beside the frames, and l the residuals
/// whitened and refitted with the frames. Then everything follows from D_h' l and D_h' D_g. Bad
/// poses with the orthonormal directions Z leave the part (I - Z Z') l of l, and the columns (I - Z
/// Z') D_h of h. With M = D_h' Z and v = D_h' (I - Z Z') l the hypothesis explains
///   v' (I - M M')^+ v,
/// and loses the directions that Z makes up for. A set of bad poses costs a few matrices as small
/// as h and Z, whatever the number of rows; a check of 60 poses looks at thousands of sets.
class TestsBesidePoses {
 public:
  /// The residuals of one check as the tests see them.
  struct Seen {
    double square = 0;      ///< |l|²
    Eigen::VectorXd along;  ///< D' l of all hypotheses, one after the other
  };
  /// Beside one set of bad poses.
  class Beside {
   public:
    /// Numbers that the test of a hypothesis still looks at, and of all together.
    [[nodiscard]] int freedom(std::size_t hypothesis) const { return parts_[hypothesis].freedom; }
    [[nodiscard]] int whole_freedom() const { return whole_freedom_; }
    /// The residuals beside the bad poses.
    [[nodiscard]] Seen left(const Seen& seen) const;
    /// The part of left() that a hypothesis explains.
    [[nodiscard]] double explained(std::size_t hypothesis, const Seen& left) const;
    /// Numbers that it holds.
    [[nodiscard]] std::size_t size() const;

   private:
    friend class TestsBesidePoses;
    /// v' (I - M M')^+ v = v'v + the sum of weight_k (turn_k v)².
    struct Part {
      Eigen::Index first = 0, count = 0;
      int freedom = 0;
      Eigen::MatrixXd turn;
      Eigen::VectorXd weight;
    };
    Eigen::MatrixXd by_poses_;  // D' Z, of all hypotheses
    Eigen::MatrixXd root_;      // Z = Y root, Y the bad poses' own directions
    std::vector<Eigen::Index> own_;
    std::vector<Part> parts_;
    int whole_freedom_ = 0;
  };

  /// `directions`: those of each hypothesis beside the frames; from `causes` on they belong to
  /// single poses. `freedom`: that of the residuals there.
  TestsBesidePoses(const std::vector<Eigen::MatrixXd>& directions, std::size_t causes, int freedom);

  /// `left`: R, whitened, refitted with the frames.
  [[nodiscard]] Seen seen(const Eigen::VectorXd& left) const;
  [[nodiscard]] Beside beside(const std::vector<int>& bad) const;
  /// The number of hypotheses.
  [[nodiscard]] std::size_t size() const { return first_.size() - 1; }

 private:
  [[nodiscard]] static Beside::Part part_of(const Eigen::MatrixXd& M);

  std::size_t causes_;
  int freedom_;
  std::vector<Eigen::Index> first_;  // column of each hypothesis, and the end
  Eigen::MatrixXd directions_;       // R x all
  Eigen::MatrixXd by_pose_;          // D' D of all hypotheses by the single poses
};

}  // namespace trammel::health
