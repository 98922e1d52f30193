#include <utility>
#include <vector>

#include "server/base/units.h"
#include "server/dds/codec.h"
#include "server/dds/handlers.h"
#include "server/measurement/pose_check.h"

namespace trammel {
namespace {

wire::PredictedError to_wire(const ErrorPrediction& prediction) {
  wire::PredictedError item;
  item.nominal(trammel::to_wire(prediction.X_BT_nominal));
  item.predicted(trammel::to_wire(prediction.X_BT_predicted));
  item.dx_mm(to_mm(prediction.error_B.x()));
  item.dy_mm(to_mm(prediction.error_B.y()));
  item.dz_mm(to_mm(prediction.error_B.z()));
  item.sx_mm(to_mm(prediction.stddev_B.x()));
  item.sy_mm(to_mm(prediction.stddev_B.y()));
  item.sz_mm(to_mm(prediction.stddev_B.z()));
  item.in_domain(prediction.in_domain);
  return item;
}

/// Its joints are checked, its model is taken.
class PortionedPredictions final : public PortionedAnswer<wire::PredictErrorReply> {
 public:
  PortionedPredictions(Subject subject, std::vector<JointVector> joints)
      : subject_(std::move(subject)), joints_(std::move(joints)) {
    reply_.model(trammel::to_wire(*subject_.served, subject_.in_force, unix_now_s()));
    reply_.predictions().resize(joints_.size());
  }
  std::size_t items() const override { return joints_.size(); }
  void compute(std::size_t first, std::size_t count) override {
    const CompensatedModel& model = subject_.served->model;
    for (std::size_t i = first; i < first + count; ++i) {
      reply_.predictions()[i] = to_wire(model.predict(joints_[i], subject_.tool, subject_.payload));
    }
  }
  wire::PredictErrorReply take() override { return std::move(reply_); }

 private:
  const Subject subject_;
  const std::vector<JointVector> joints_;
  wire::PredictErrorReply reply_;
};

}  // namespace

Result<Handlers::Predictions> Handlers::begin(const wire::PredictErrorRequest& request) {
  const auto& wanted = request.joints_rad();
  if (wanted.size() > wire::MAX_TARGETS) {
    return failure(ErrorCode::kTooLarge, "{} joint vectors in one request, limit {}", wanted.size(), wire::MAX_TARGETS)
        .beyond(wanted.size(), wire::MAX_TARGETS);
  }
  auto subject = subjects_.find(request.about());
  if (!subject) return tl::make_unexpected(subject.error());
  const Cell& cell = subject->served->model.cell();

  std::vector<JointVector> joints;
  joints.reserve(wanted.size());
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    const auto q = from_wire(wanted[i], cell.robot, fmt::format("joint vector {}", i + 1));
    if (!q) return tl::make_unexpected(q.error());
    PoseContext pose;
    pose.q = *q;
    pose.tool = subject->tool;
    pose.payload = subject->payload;
    const Status possible = check_pose(pose, cell);
    if (!possible) return Failure(possible.error()).in(fmt::format("joint vector {}", i + 1));
    joints.push_back(*q);
  }
  return std::make_unique<PortionedPredictions>(std::move(*subject), std::move(joints));
}

Result<wire::PredictErrorReply> Handlers::answer(const wire::PredictErrorRequest& request) {
  return computed(begin(request));
}

bool happens_once(const wire::PredictErrorRequest&) { return false; }

}  // namespace trammel
