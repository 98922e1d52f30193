#include "server/http/metric_families.h"

#include <prometheus/text_serializer.h>

#include <limits>

namespace trammel {

prometheus::ClientMetric& MetricFamilies::add(const char* name, const char* help,
                                              prometheus::MetricType type,
                                              const MetricLabels& labels) {
  const auto [at, is_new] = at_.emplace(name, families_.size());
  if (is_new) families_.push_back({name, help, type, {}});
  prometheus::ClientMetric& metric = families_[at->second].metric.emplace_back();
  for (const auto& [label, value] : labels) metric.label.push_back({label, value});
  return metric;
}

void MetricFamilies::gauge(const char* name, const char* help, double value,
                           const MetricLabels& labels) {
  add(name, help, prometheus::MetricType::Gauge, labels).gauge.value = value;
}

void MetricFamilies::counter(const char* name, const char* help, double value,
                             const MetricLabels& labels) {
  add(name, help, prometheus::MetricType::Counter, labels).counter.value = value;
}

void MetricFamilies::histogram(const char* name, const char* help, std::span<const double> bounds,
                               std::span<const std::uint64_t> in_class, double sum,
                               const MetricLabels& labels) {
  auto& histogram = add(name, help, prometheus::MetricType::Histogram, labels).histogram;
  std::uint64_t below = 0;
  for (std::size_t i = 0; i < in_class.size(); ++i) {
    below += in_class[i];
    histogram.bucket.push_back(
        {below, i == bounds.size() ? std::numeric_limits<double>::infinity() : bounds[i]});
  }
  histogram.sample_count = below;
  histogram.sample_sum = sum;
}

std::string MetricFamilies::text() const {
  return prometheus::TextSerializer().Serialize(families_);
}

}  // namespace trammel
