// Pure pursuit of the reference line, at the line's speeds.
//
// SI units; x east, y north, angles counter-clockwise, left positive. Geometry: Coulter,
// Implementation of the Pure Pursuit Path Tracking Algorithm, 1992.

#pragma once

#include <cstddef>
#include <vector>

#include "session_generated.h"
#include "spectate_generated.h"


using Karts = flatbuffers::Vector<const race::spectate::Kart*>;

struct Wishes {
  double steering = 0.0;  // [-1, 1]
  double throttle = 0.0;  // [0, 1]
  double brake = 1.0;     // [0, 1]
};

// What flags and effects allow this kart.
struct Limits {
  double speed_cap = 0.0;   // [m/s]
  double grip_scale = 1.0;  // [-]
};

class Pursuit {
 public:
  Pursuit(const race::session::Briefing& briefing, const race::session::Course& course,
          const race::session::Line& line);

  // Returns steering and pedals, given all karts of a snapshot.
  Wishes decide(const race::spectate::Kart& kart, const Karts& karts, const Limits& limits) const;

 private:
  struct Sample {
    double x, y, speed;  // [m], [m], [m/s]
  };
  struct Point {
    double ahead, aside;  // [m] of the rear axle, to its left
  };

  Point seen(const race::spectate::Kart& kart, double x, double y) const;
  double limit_of_line(std::size_t place, double speed, double grip) const;
  double limit_behind(const race::spectate::Kart& kart, const Karts& karts) const;

  std::vector<Sample> line_;
  std::vector<std::size_t> beside_;  // sample of the line beside each of the centre line
  double step_, centre_step_;        // [m] between samples of the line, of the centre line
  double wheelbase_, rear_axle_, length_, width_;  // [m]
  double steering_limit_;                          // [rad]
  double mass_, motor_force_, brake_force_;        // [kg], [N], [N]
  double braking_;                                 // [m/s²]
};
