#pragma once

#include <prometheus/metric_family.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

#include "server/metrics/latency_histogram.h"

namespace trammel {

using MetricLabels = std::vector<std::pair<const char*, std::string>>;

/// Collects metrics in the order in which they are told.
class MetricFamilies {
 public:
  void gauge(const char* name, const char* help, double value, const MetricLabels& labels = {});
  void counter(const char* name, const char* help, double value, const MetricLabels& labels = {});
  void histogram(const char* name, const char* help, const LatencyHistogram::Counts& counts,
                 const MetricLabels& labels = {});

  /// In Prometheus' text format.
  [[nodiscard]] std::string text() const;

 private:
  prometheus::ClientMetric& add(const char* name, const char* help, prometheus::MetricType type,
                                const MetricLabels& labels);

  std::vector<prometheus::MetricFamily> families_;
  std::map<std::string, std::size_t, std::less<>> at_;  // by name
};

}  // namespace trammel
