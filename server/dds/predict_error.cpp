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

}  // namespace

Result<wire::PredictErrorReply> Handlers::answer(const wire::PredictErrorRequest& request) {
  const auto& joints = request.joints_rad();
  if (joints.size() > wire::MAX_TARGETS) {
    return failure(ErrorCode::kTooLarge, "{} joint vectors in one request, limit {}", joints.size(), wire::MAX_TARGETS)
        .beyond(joints.size(), wire::MAX_TARGETS);
  }
  const auto subject = subjects_.find(request.about());
  if (!subject) return tl::make_unexpected(subject.error());
  const CompensatedModel& model = subject->served->model;

  wire::PredictErrorReply reply;
  reply.model(trammel::to_wire(*subject->served, subject->in_force, unix_now_s()));
  reply.predictions().reserve(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i) {
    const auto q = from_wire(joints[i], model.cell().robot, fmt::format("joint vector {}", i + 1));
    if (!q) return tl::make_unexpected(q.error());
    PoseContext pose;
    pose.q = *q;
    pose.tool = subject->tool;
    pose.payload = subject->payload;
    const Status possible = check_pose(pose, model.cell());
    if (!possible) return Failure(possible.error()).in(fmt::format("joint vector {}", i + 1));
    reply.predictions().push_back(to_wire(model.predict(*q, subject->tool, subject->payload)));
  }
  return reply;
}

bool happens_once(const wire::PredictErrorRequest&) { return false; }

}  // namespace trammel
