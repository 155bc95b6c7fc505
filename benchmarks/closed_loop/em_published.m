% The published observer and one iteration of expectation-maximisation, as one writes it in Octave:
%
%   octave-cli em_published.m RECORD.mat [REPEATS]
%
% The recursions go sample by sample, everything else over all samples at once, or sample by sample
% too, as the published implementation does it. Prints processor seconds of a forward pass and of an
% iteration of either kind, smallest of REPEATS, then the log-likelihood and the variances found by
% both. `octave.py` writes the record and compares.
1;

function c = coefficients(car, v, cf, cr)
  s = max(v, 1);
  turn = cf * car.lf - cr * car.lr;
  if numel(v) > 1
    turn = cf .* car.lf - cr .* car.lr;
  end
  c = [-(cf + cr) ./ (car.m * s), -turn ./ (car.m * s), -turn ./ (car.i * s), ...
       -(cf * car.lf^2 + cr * car.lr^2) ./ (car.i * s)];
end

function C = pages(A, B)
  % Products of matrices along the third dimension.
  C = A(:, 1, :) .* B(1, :, :);
  for j = 2:columns(A)
    C += A(:, j, :) .* B(j, :, :);
  end
end

function run = forward(car, u, y, q, r, keep)
  n = rows(y);
  Q = diag(q);
  R = diag(r);
  G = car.dt * [1 / car.m, 1 / car.m, 1 / car.i];
  push = [u(:, 1), u(:, 3) .* u(:, 2), car.lf * u(:, 3) .* u(:, 2)]' .* G';
  A0 = eye(6);
  A0(1, 1) -= car.dt * car.drag / car.m;
  A0(1, 4) = G(1);
  A0(2, 5) = G(2);
  A0(3, 6) = G(3);
  H = [eye(3), zeros(3, 3); 0, 0, 0, 0, 1 / car.m, 0];
  one = eye(6);
  x = [5; 0; 0; 0; 0; 0];
  P = zeros(6);
  if keep
    run.A = run.Pp = run.Pf = zeros(6, 6, n);
    run.xp = run.xf = zeros(6, n);
  end
  yt = y';
  cf = u(:, 3);
  cr = u(:, 4);
  run.value = 0;
  constant = 4 * log(2 * pi);
  for k = 1:n
    c = coefficients(car, x(1), cf(k), cr(k));
    A = A0;
    A(2, 2) += car.dt * c(1);
    A(2, 3) = car.dt * (c(2) - x(1));
    A(3, 2) = car.dt * c(3);
    A(3, 3) += car.dt * c(4);
    H(4, 2) = c(1);
    H(4, 3) = c(2);
    x = A * x;
    x(1:3) += push(:, k);
    P = A * P * A' + Q;
    if keep
      run.A(:, :, k) = A;
      run.xp(:, k) = x;
      run.Pp(:, :, k) = P;
    end
    S = H * P * H' + R;
    K = P * H' / S;
    e = yt(:, k) - H * x;
    L = one - K * H;
    x += K * e;
    P = L * P * L' + K * R * K';
    run.value -= 0.5 * (e' * (S \ e) + log(det(S)) + constant);
    if keep
      run.xf(:, k) = x;
      run.Pf(:, :, k) = P;
    end
  end
end

function [value, q, r] = em_iteration(car, u, y, q, r, in_loops)
  n = rows(y);
  run = forward(car, u, y, q, r, true);
  xs = run.xf;
  Ps = run.Pf;
  J = zeros(6, 6, n - 1);
  ridge = 1e-9 * eye(6);
  for k = n - 1:-1:1
    Pf = run.Pf(:, :, k);
    Pp = run.Pp(:, :, k + 1);
    % The published smoother takes the matrix of one sample before.
    Jk = Pf * run.A(:, :, k)' / (Pp + ridge);
    xs(:, k) = run.xf(:, k) + Jk * (xs(:, k + 1) - run.xp(:, k + 1));
    Ps(:, :, k) = Pf + Jk * (Ps(:, :, k + 1) - Pp) * Jk';
    J(:, :, k) = Jk;
  end
  value = run.value;
  if in_loops
    [q, r] = maximised_in_loops(car, u, y, xs, Ps, J);
    return;
  end

  % Sensors, linearised at the smoothed states.
  v = xs(1, :)';
  c = coefficients(car, v, u(:, 3), u(:, 4));
  H = zeros(4, 6, n);
  H(1, 1, :) = H(2, 2, :) = H(3, 3, :) = 1;
  H(4, 2, :) = c(:, 1);
  H(4, 3, :) = c(:, 2);
  H(4, 5, :) = 1 / car.m;
  seen = [xs(1:3, :); c(:, 1)' .* xs(2, :) + c(:, 2)' .* xs(3, :) + xs(5, :) / car.m];
  spread = squeeze(sum(pages(H, Ps) .* H, 2));
  r = mean((y' - seen).^2 + spread, 2);

  % Process: from each smoothed state to the next.
  before = 1:n - 1;
  after = 2:n;
  c = c(before, :);
  v = v(before);
  A = repmat(eye(6), [1, 1, n - 1]);
  A(1, 1, :) -= car.dt * car.drag / car.m;
  A(2, 2, :) += reshape(car.dt * c(:, 1), 1, 1, []);
  A(2, 3, :) = car.dt * (c(:, 2) - v);
  A(3, 2, :) = car.dt * c(:, 3);
  A(3, 3, :) += reshape(car.dt * c(:, 4), 1, 1, []);
  A(1, 4, :) = A(2, 5, :) = car.dt / car.m;
  A(3, 6, :) = car.dt / car.i;
  xb = reshape(xs(:, before), 1, 6, []);
  next = reshape(sum(A .* xb, 2), 6, []);
  steer = u(before, 2)';
  next(1, :) += car.dt / car.m * u(before, 1)';
  next(2, :) += car.dt / car.m * u(before, 3)' .* steer;
  next(3, :) += car.dt / car.i * car.lf * u(before, 3)' .* steer;
  w = xs(:, after) - next;
  AP = squeeze(sum(pages(A, Ps(:, :, before)) .* A, 2));
  mixed = squeeze(sum(pages(Ps(:, :, after), permute(J, [2, 1, 3])) .* A, 2));
  own = zeros(6, n - 1);
  for i = 1:6
    own(i, :) = Ps(i, i, after);
  end
  q = mean(w.^2 + own + AP - 2 * mixed, 2);
end

function [q, r] = maximised_in_loops(car, u, y, xs, Ps, J)
  n = rows(y);
  R = zeros(4);
  Q = zeros(6);
  H = [eye(3), zeros(3, 3); 0, 0, 0, 0, 1 / car.m, 0];
  A0 = eye(6);
  A0(1, 1) -= car.dt * car.drag / car.m;
  A0(1, 4) = A0(2, 5) = car.dt / car.m;
  A0(3, 6) = car.dt / car.i;
  for k = 1:n
    x = xs(:, k);
    c = coefficients(car, x(1), u(k, 3), u(k, 4));
    H(4, 2) = c(1);
    H(4, 3) = c(2);
    e = y(k, :)' - H * x;
    R += e * e' + H * Ps(:, :, k) * H';
    if k < n
      A = A0;
      A(2, 2) += car.dt * c(1);
      A(2, 3) = car.dt * (c(2) - x(1));
      A(3, 2) = car.dt * c(3);
      A(3, 3) += car.dt * c(4);
      next = A * x;
      next(1) += car.dt / car.m * u(k, 1);
      next(2) += car.dt / car.m * u(k, 3) * u(k, 2);
      next(3) += car.dt / car.i * car.lf * u(k, 3) * u(k, 2);
      w = xs(:, k + 1) - next;
      lag = Ps(:, :, k + 1) * J(:, :, k)' * A';
      Q += w * w' + Ps(:, :, k + 1) + A * Ps(:, :, k) * A' - lag - lag';
    end
  end
  q = diag(Q) / (n - 1);
  r = diag(R) / n;
end

arguments = argv();
record = load(arguments{1});
repeats = 3;
if numel(arguments) > 1
  repeats = str2double(arguments{2});
end
car = record.car;
seconds = [inf, inf, inf];
for k = 1:repeats
  t = cputime();
  forward(car, record.u, record.y, record.q, record.r, false);
  seconds(1) = min(seconds(1), cputime() - t);
  t = cputime();
  [value, q, r] = em_iteration(car, record.u, record.y, record.q, record.r, false);
  seconds(2) = min(seconds(2), cputime() - t);
  t = cputime();
  [again, ql, rl] = em_iteration(car, record.u, record.y, record.q, record.r, true);
  seconds(3) = min(seconds(3), cputime() - t);
end
printf("%.17g ", seconds, value, q, r, again, ql, rl);
printf("\n");
