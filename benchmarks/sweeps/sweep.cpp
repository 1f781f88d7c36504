// Fixed point (27) over many h, x = A^+ b(x) + (I - A^+ A) h 1, in C++ with Eigen.
//
// full:    the 24 unknowns and the 24 by 24 matrix A^+ in the loop, as (27) stands.
// reduced: the eight forces that friction reads in the loop, the 24 unknowns once after it.
//
// Matrices are column-major; out has 24 numbers per h.

#include <Eigen/Dense>
#include <thread>
#include <vector>

namespace {

using Vector = Eigen::Matrix<double, 24, 1>;
using Matrix = Eigen::Matrix<double, 24, 24>;
using Spread = Eigen::Matrix<double, 24, 4>;
using Moments = Eigen::Matrix<double, 4, 1>;

struct Data {
    Matrix inverse;
    Vector right, shift;
    Spread spread;
    Moments gain;
};

constexpr double kTolerance = 1e-12;

template <class Loads>
Moments law(const Data& d, const Loads& r) {
    Moments tau;
    for (int j = 0; j < 4; ++j) tau[j] = d.gain[j] * std::sqrt(r[2 * j] * r[2 * j] + r[2 * j + 1] * r[2 * j + 1]);
    return tau;
}

Vector full(const Data& d, double h) {
    Vector shift = d.shift * h, x = d.inverse * d.right + shift, b = d.right;
    Moments tau = Moments::Zero();
    for (int step = 0; step < 1000; ++step) {
        Moments fresh = law(d, x.segment<8>(12));
        b.segment<3>(8) = d.right.segment<3>(8) +
            Eigen::Vector3d(fresh[0] - fresh[1], fresh[1] - fresh[2], fresh[2] + fresh[3]);
        x.noalias() = d.inverse * b;
        x += shift;
        if ((fresh - tau).cwiseAbs().maxCoeff() < kTolerance) break;
        tau = fresh;
    }
    return x;
}

Vector reduced(const Data& d, const Vector& free, double h) {
    Vector base = free + d.shift * h;
    Eigen::Matrix<double, 8, 4> slope = d.spread.middleRows<8>(12);
    Eigen::Matrix<double, 8, 1> loads = base.segment<8>(12), rho = loads;
    Moments tau = Moments::Zero();
    for (int step = 0; step < 1000; ++step) {
        Moments fresh = law(d, rho);
        rho.noalias() = slope * fresh;
        rho += loads;
        bool done = (fresh - tau).cwiseAbs().maxCoeff() < kTolerance;
        tau = fresh;
        if (done) break;
    }
    base.noalias() += d.spread * tau;
    return base;
}

}  // namespace

extern "C" void sweep(const double* inverse, const double* right, const double* shift, const double* spread,
                      const double* gain, const double* h, long count, int threads, int whole, double* out) {
    const Data d{Matrix(inverse), Vector(right), Vector(shift), Spread(spread), Moments(gain)};
    const Vector free = d.inverse * d.right;
    auto part = [&](long begin, long end) {
        for (long i = begin; i < end; ++i)
            Eigen::Map<Vector>(out + 24 * i) = whole ? full(d, h[i]) : reduced(d, free, h[i]);
    };
    std::vector<std::thread> pool;
    for (int k = 0; k < threads; ++k) pool.emplace_back(part, count * k / threads, count * (k + 1) / threads);
    for (auto& thread : pool) thread.join();
}
