#include "pursuit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <string>

namespace {

using race::session::Briefing;
using race::spectate::Kart;

constexpr double gravity = 9.81;       // [m/s²]
constexpr double look_s = 0.16;        // aims at the point of the line this far ahead in time
constexpr double shortest_look = 1.5;  // wheelbases
constexpr double delay_s = 0.1;        // from a snapshot until its control acts on the wheels
// A line of minimum time takes all the grip; this driver keeps some to correct its errors.
constexpr double speed_share = 0.86;
constexpr double brake_share = 0.5;    // of what brakes and tyres can give
constexpr double close_s = 0.1;        // pedals reach the wanted speed within this time

double number(const Briefing& briefing, const std::string& name) {
  const auto& names = *briefing.vehicle_names();
  const auto& values = *briefing.vehicle_values();
  for (flatbuffers::uoffset_t index = 0; index < std::min(names.size(), values.size()); ++index) {
    if (names[index]->str() == name) {
      return values[index];
    }
  }
  throw std::runtime_error("the briefing does not have the vehicle's " + name);
}

}  // namespace

Pursuit::Pursuit(const Briefing& briefing, const race::session::Course& course,
                 const race::session::Line& line)
    : step_(line.spacing()),
      centre_step_(course.spacing()),
      wheelbase_(number(briefing, "front_axle") + number(briefing, "rear_axle")),
      rear_axle_(number(briefing, "rear_axle")),
      length_(number(briefing, "length")),
      width_(number(briefing, "width")),
      steering_limit_(number(briefing, "steering_limit")),
      mass_(number(briefing, "mass")),
      motor_force_(number(briefing, "motor_force")),
      brake_force_(number(briefing, "brake_force")),
      braking_(brake_share * std::min(number(briefing, "grip") * gravity, brake_force_ / mass_)) {
  for (flatbuffers::uoffset_t index = 0; index < line.x()->size(); ++index) {
    line_.push_back({line.x()->Get(index), line.y()->Get(index), line.speed()->Get(index)});
  }
  // Both lines begin side by side; per sample of the centre line the other advances by at most
  // three of its own.
  const auto reach = static_cast<std::size_t>(std::ceil(3.0 * centre_step_ / step_));
  const auto& centre = *course.line();  // x, y, heading, curvature of each sample
  std::size_t place = 0;
  for (flatbuffers::uoffset_t at = 0; at + 3 < centre.size(); at += 4) {
    const auto far = [&](std::size_t other) {
      const Sample& sample = line_[other % line_.size()];
      return std::hypot(sample.x - centre[at], sample.y - centre[at + 1]);
    };
    std::size_t nearest = place;
    for (std::size_t other = place; other <= place + reach; ++other) {
      nearest = far(other) < far(nearest) ? other : nearest;
    }
    place = nearest;
    beside_.push_back(place % line_.size());
  }
}

Wishes Pursuit::decide(const Kart& kart, const Karts& karts, const Limits& limits) const {
  const double speed = std::max(static_cast<double>(kart.speed()), 0.0);
  const double progress = std::max(kart.progress() + speed * delay_s, 0.0);
  const auto sample = static_cast<std::size_t>(progress / centre_step_);
  const std::size_t place = beside_[sample % beside_.size()];
  const double look = std::max(shortest_look * wheelbase_, look_s * speed);
  const Sample& aim = line_[(place + std::lround(look / step_)) % line_.size()];
  const Point point = seen(kart, aim.x, aim.y);
  const double square = point.ahead * point.ahead + point.aside * point.aside;
  const double angle = std::atan2(2.0 * wheelbase_ * point.aside, square);
  const double limit = std::min({limit_of_line(place, speed, limits.grip_scale),
                                 limit_behind(kart, karts), limits.speed_cap});
  const double force = mass_ * (limit - speed) / close_s;
  return {std::clamp(angle / steering_limit_, -1.0, 1.0),
          std::clamp(force / motor_force_, 0.0, 1.0),
          std::clamp(-force / brake_force_, 0.0, 1.0)};
}

// Returns a point as seen from the rear axle once the control acts.
Pursuit::Point Pursuit::seen(const Kart& kart, double x, double y) const {
  const double heading = kart.heading() + kart.yaw_rate() * delay_s;
  const double forward = kart.speed() * delay_s - rear_axle_;
  const double east = x - kart.x() - forward * std::cos(heading);
  const double north = y - kart.y() - forward * std::sin(heading);
  return {east * std::cos(heading) + north * std::sin(heading),
          north * std::cos(heading) - east * std::sin(heading)};
}

// Returns the highest speed from which braking still reaches all speeds of the line ahead.
double Pursuit::limit_of_line(std::size_t place, double speed, double grip) const {
  const double horizon = speed * speed / (2.0 * braking_ * step_) + 1.0;
  double square = std::numeric_limits<double>::infinity();
  for (std::size_t index = 0; index < line_.size() && index < horizon; ++index) {
    const double wanted = speed_share * line_[(place + index) % line_.size()].speed;
    square = std::min(square, wanted * wanted * std::min(grip, 1.0) +
                                  2.0 * braking_ * step_ * static_cast<double>(index));
  }
  return std::sqrt(square);
}

// Returns the speed that keeps the distance to a kart ahead: this driver does not overtake.
double Pursuit::limit_behind(const Kart& kart, const Karts& karts) const {
  double square = std::numeric_limits<double>::infinity();
  for (const Kart* other : karts) {
    const Point point = seen(kart, other->x(), other->y());
    const bool is_in_way = other->status() == race::codes::Status_RACING && other->seat() != kart.seat() &&
                           point.ahead > 0.0 && std::abs(point.aside) < 1.2 * width_;
    if (is_in_way) {
      const double across = other->heading() - kart.heading();
      const double pace = std::max(other->speed() * std::cos(across), 0.0);
      const double gap = std::max(point.ahead - 1.7 * length_, 0.0);
      square = std::min(square, pace * pace + 2.0 * braking_ * gap);
    }
  }
  return std::sqrt(square);
}
