#include "server/robot/cell_values_file.h"

#include <cmath>

#include "server/base/name_check.h"
#include "server/base/units.h"

namespace trammel {

namespace {

constexpr double kFarthestMm = 1e9;   // for any frame or point: no cell is larger
constexpr double kWorstSigma = 5e-3;  // m; every instrument for robots is better

double read_radius(const YamlMap& map, const std::string& key) {
  const double radius = map.number(key);
  if (!(radius > 0)) map.refuse(key, refused("must be above 0").beyond(radius, 0));
  return from_mm(radius);
}

/// The shape of an anchor: a point, unless a key says that it is a sphere, a plane or a ring.
void read_shape(const YamlMap& map, Anchor& anchor) {
  const bool sphere = map.has("sphere_radius_mm"), plane = map.has("plane_normal"),
             ring = map.has("ring_axis");
  if (sphere + plane + ring > 1)
    map.refuse(plane ? "plane_normal" : "ring_axis", "an anchor is one of sphere, plane and ring");
  if (ring != map.has("ring_radius_mm"))
    map.refuse("ring_radius_mm", "ring_axis and ring_radius_mm belong together");
  if (sphere) {
    anchor.shape = Anchor::Shape::kSphere;
    anchor.radius = read_radius(map, "sphere_radius_mm");
  } else if (plane) {
    anchor.shape = Anchor::Shape::kPlane;
    anchor.direction_W = read_direction(map, "plane_normal");
  } else if (ring) {
    anchor.shape = Anchor::Shape::kRing;
    anchor.direction_W = read_direction(map, "ring_axis");
    anchor.radius = read_radius(map, "ring_radius_mm");
  }
  if (ring && !anchor.p_W) map.refuse("xyz_mm", "where a ring is must be known");
}

Anchor read_anchor(const YamlMap& map) {
  map.only({"xyz_mm", "zero_mm", "sigma_mm", "sphere_radius_mm", "plane_normal", "ring_axis",
            "ring_radius_mm"});
  Anchor anchor;
  if (!map.is_null("xyz_mm")) anchor.p_W = read_vector(map, "xyz_mm") * from_mm(1);
  if (!map.is_null("zero_mm")) anchor.zero = from_mm(map.number("zero_mm"));
  anchor.zero_open = map.has("zero_mm") && map.is_null("zero_mm");
  if (!map.is_null("sigma_mm")) {
    const double sigma = map.number("sigma_mm");
    if (!(sigma > 0)) map.refuse("sigma_mm", refused("must be above 0").beyond(sigma, 0));
    anchor.sigma = from_mm(sigma);
  }
  read_shape(map, anchor);
  return anchor;
}

}  // namespace

Vector3 read_vector(const YamlMap& map, const std::string& key) {
  const std::vector<double> v = map.numbers(key, 3);
  for (const double value : v) {
    if (std::abs(value) > kFarthestMm)
      map.refuse(key, refused("{:g}, limit {:g}", value, kFarthestMm).beyond(value, kFarthestMm));
  }
  return {v[0], v[1], v[2]};
}

Vector3 read_direction(const YamlMap& map, const std::string& key) {
  const Vector3 direction = read_vector(map, key);
  if (direction.norm() < 1e-9) map.refuse(key, "a direction of length 0");
  return direction.normalized();
}

void check_key(const YamlMap& map, const std::string& name, const char* what) {
  if (name.empty()) map.refuse(name, refused("a {} without a name", what));
  if (const Status fine = check_name(name, what); !fine) map.refuse(name, Failure(fine.error()));
}

Tracker read_tracker(const YamlMap& map) {
  map.only({"sigma_mm", "sigma_deg", "xyz_mm", "aperture_deg", "target_normal"});
  Tracker tracker;
  tracker.sigma = from_mm(map.number("sigma_mm", to_mm(tracker.sigma)));
  tracker.sigma_rotation = from_deg(map.number("sigma_deg", to_deg(tracker.sigma_rotation)));
  if (tracker.sigma <= 0)
    map.refuse("sigma_mm", refused("must be above 0").beyond(to_mm(tracker.sigma), 0));
  if (tracker.sigma > kWorstSigma) {
    map.refuse("sigma_mm", refused("{:g}, limit {:g}", to_mm(tracker.sigma), to_mm(kWorstSigma))
                               .beyond(to_mm(tracker.sigma), to_mm(kWorstSigma))
                               .next("in micrometres? write it in mm"));
  }
  if (tracker.sigma_rotation <= 0)
    map.refuse("sigma_deg", refused("must be above 0").beyond(to_deg(tracker.sigma_rotation), 0));
  if (!map.is_null("xyz_mm")) tracker.p_W = read_vector(map, "xyz_mm") * from_mm(1);
  if (map.has("aperture_deg")) {
    tracker.aperture = from_deg(map.number("aperture_deg"));
    if (!(*tracker.aperture > 0 && *tracker.aperture <= kPi))
      map.refuse("aperture_deg",
                 refused("must be above 0, at most 180")
                     .beyond(to_deg(*tracker.aperture), *tracker.aperture > 0 ? 180 : 0));
  }
  if (map.has("target_normal")) {
    tracker.target_normal_T = read_vector(map, "target_normal");
    if (tracker.target_normal_T.norm() < 1e-9)
      map.refuse("target_normal", "a direction of length 0");
    tracker.target_normal_T.normalize();
  }
  return tracker;
}

Anchors read_anchors(const YamlMap& map) {
  Anchors all;
  if (map.is_null("anchors")) return all;
  const YamlMap anchors = map.map("anchors");
  for (const std::string& name : anchors.keys()) {
    anchors.attempt([&] {
      check_key(anchors, name, "anchor");
      all[name] = anchors.is_null(name) ? Anchor{} : read_anchor(anchors.map(name));
    });
  }
  return all;
}

}  // namespace trammel
