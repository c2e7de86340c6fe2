#!/usr/bin/env python3
"""Drive the sedan by keyboard: `halfarrow run` computes it in real time, a page in the browser steers it and shows where it goes.

    python3 drive.py                        then open http://127.0.0.1:8000
    python3 drive.py --program ./halfarrow --rate 500Hz --set u0=10

What it does not know it hands on to `halfarrow run`. Python's standard library is all it needs. Ctrl-C ends it; `run` then
tells how long steps took and how many ticks were missed.
"""

import argparse
import json
import pathlib
import signal
import socket
import subprocess
import threading
import time
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

HERE = pathlib.Path(__file__).resolve().parent
# Sent by `run` after the time of the model.
VALUES = ["x", "y", "car.yaw", "speed", "yaw_rate", "roll", "load_fl", "load_fr", "load_rl", "load_rr", "car.rl.wheel.speed", "car.rr.wheel.speed"]
WHEELBASE, RADIUS, RATIO = 2.776, 0.33, 0.36  # in m, in m; angle of the front wheels over that of the steering wheel

PAGE = """<!doctype html><meta charset="utf-8"><title>Sedan</title>
<style>body{margin:0;font:15px sans-serif;background:#fff;color:#222}canvas{display:block}
#told{position:fixed;left:12px;top:12px;background:#fffc;padding:8px 12px;white-space:pre;font-family:monospace}</style>
<canvas id="road"></canvas><div id="told">no car yet</div>
<script>
const keys = {ArrowLeft: 'left', ArrowRight: 'right', ArrowUp: 'faster', ArrowDown: 'slower', a: 'left', d: 'right', w: 'faster', s: 'slower'};
const held = new Set(), path = [], canvas = document.getElementById('road'), told = document.getElementById('told');
let car = null;
const tell = () => fetch('/keys', {method: 'POST', body: JSON.stringify([...held])});
for (const kind of ['keydown', 'keyup']) addEventListener(kind, event => {
  const key = keys[event.key];
  if (!key) return;
  event.preventDefault();
  if (kind === 'keydown' ? held.has(key) : !held.has(key)) return;
  kind === 'keydown' ? held.add(key) : held.delete(key);
  tell();
});
addEventListener('blur', () => { held.clear(); tell(); });
new EventSource('/told').onmessage = event => {
  car = JSON.parse(event.data);
  const last = path[path.length - 1];
  if (last && Math.hypot(last[0] - car.x, last[1] - car.y) > 50) path.length = 0;
  if (!last || Math.hypot(last[0] - car.x, last[1] - car.y) > 0.3) path.push([car.x, car.y]);
  if (path.length > 5000) path.shift();
  draw();
};
function draw() {
  const w = canvas.width = innerWidth, h = canvas.height = innerHeight, scale = 10, c = canvas.getContext('2d');
  const px = x => w / 2 + scale * (x - car.x), py = y => h / 2 - scale * (y - car.y);
  c.strokeStyle = '#ddd'; c.lineWidth = 1; c.beginPath();
  for (let x = Math.ceil((car.x - w / 2 / scale) / 10) * 10; px(x) < w; x += 10) { c.moveTo(px(x), 0); c.lineTo(px(x), h); }
  for (let y = Math.ceil((car.y - h / 2 / scale) / 10) * 10; py(y) > 0; y += 10) { c.moveTo(0, py(y)); c.lineTo(w, py(y)); }
  c.stroke();
  c.strokeStyle = '#888'; c.lineWidth = 2; c.beginPath();
  path.forEach(([x, y], i) => i ? c.lineTo(px(x), py(y)) : c.moveTo(px(x), py(y)));
  c.stroke();
  c.save(); c.translate(w / 2, h / 2); c.rotate(-car.yaw); c.scale(scale, -scale);
  c.fillStyle = '#3572a5'; c.fillRect(-2.2, -0.9, 4.5, 1.8);
  const loads = [car.load_fl, car.load_fr, car.load_rl, car.load_rr], places = [[1.388, 0.8], [1.388, -0.8], [-1.388, 0.8], [-1.388, -0.8]];
  places.forEach(([x, y], i) => {
    c.save(); c.translate(x, y); if (i < 2) c.rotate(car.wheels);
    c.fillStyle = `rgb(${Math.min(255, loads[i] / 30)}, 40, 40)`; c.fillRect(-0.34, -0.12, 0.68, 0.24); c.restore();
  });
  c.restore();
  told.textContent = `speed     ${(3.6 * car.speed).toFixed(1).padStart(7)} km/h\\nyaw rate  ${(car.yaw_rate * 57.2958).toFixed(1).padStart(7)} deg/s\\n` +
    `across    ${(car.speed * car.yaw_rate).toFixed(2).padStart(7)} m/s2\\nroll      ${(car.roll * 57.2958).toFixed(2).padStart(7)} deg\\n` +
    `steering  ${(car.steer * 57.2958).toFixed(0).padStart(7)} deg\\ndrive     ${car.drive.toFixed(0).padStart(7)} N m\\nbrake     ${(100 * car.brake).toFixed(0).padStart(7)} %\\n` +
    `model     ${car.t.toFixed(2).padStart(7)} s\\nbehind    ${(1000 * car.behind).toFixed(0).padStart(7)} ms\\n\\narrows or w a s d drive`;
}
</script>"""


class Driver:
    """Keys become angles and torques as hands and feet would make them: at the speed of hands and feet."""

    def __init__(self):
        self.keys = set()
        self.steer = self.drive = self.brake = 0.0

    def move(self, told, dt):
        speed = told["speed"]
        toward = lambda now, goal, rate: now + max(-rate * dt, min(rate * dt, goal - now))
        # No further than friction follows.
        most = min(1.2, WHEELBASE / RATIO * 7.0 / max(speed * speed, 1.0))
        goal = most * (("left" in self.keys) - ("right" in self.keys))
        self.steer = toward(self.steer, goal, 1.5 if goal else 2.5)
        backward = "slower" in self.keys and speed < 0.5
        drive = 900.0 if "faster" in self.keys else -400.0 if backward else 0.0
        brake = 1.0 if "slower" in self.keys and not backward or "faster" in self.keys and speed < -0.5 else 0.0
        # With no key it stays where it stands.
        if not self.keys & {"faster", "slower"} and abs(speed) < 0.3:
            brake = 0.5
        # Less gas where a wheel spins, as traction control has it: no engine limits the speed of this car's wheels.
        spin = max(abs(RADIUS * told[f"car.{wheel}.wheel.speed"] - speed) for wheel in ("rl", "rr"))
        self.drive = toward(self.drive, drive, 2000.0) if drive else 0.0
        self.drive *= min(max((4.0 - spin) / 2.0, 0.0), 1.0)
        self.brake = toward(self.brake, brake, 4.0 if brake else 10.0)


class Car:
    """The car that `run` computes: what it told last, and what it is told 50 times a second."""

    def __init__(self, inputs, outputs):
        self.driver, self.told, self.first = Driver(), None, None
        self.out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.to = ("127.0.0.1", inputs)
        self.back = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.back.bind(("127.0.0.1", outputs))
        for work in (self.listen, self.speak):
            threading.Thread(target=work, daemon=True).start()

    def listen(self):
        while True:
            values = [float(v) for v in self.back.recv(4096).decode().split(",")]
            told = dict(zip(["t", *VALUES], values), yaw=values[3])
            now = time.monotonic()
            if self.first is None or told["t"] < 0.01:
                self.first = now - told["t"]
            self.first = min(self.first, now - told["t"])
            told["behind"] = now - told["t"] - self.first
            self.told = told

    def speak(self):
        driver, before = self.driver, time.monotonic()
        while True:
            time.sleep(0.02)
            now = time.monotonic()
            if self.told:
                driver.move(self.told, now - before)
            before = now
            said = f"steer={driver.steer:.5f},drive={driver.drive:.2f},brake={driver.brake:.4f}"
            try:
                self.out.sendto(said.encode(), self.to)
            except OSError:
                pass  # it does not listen yet

    def shown(self):
        d = self.driver
        return dict(self.told, steer=d.steer, wheels=RATIO * d.steer, drive=d.drive, brake=d.brake) if self.told else None


def pages(car):
    class Pages(BaseHTTPRequestHandler):
        def do_GET(self):
            self.send_response(200)
            if self.path == "/told":
                self.send_header("Content-Type", "text/event-stream")
                self.end_headers()
                try:
                    while True:
                        shown = car.shown()
                        if shown:
                            self.wfile.write(f"data: {json.dumps(shown)}\n\n".encode())
                            self.wfile.flush()
                        time.sleep(1 / 30)
                except OSError:
                    car.driver.keys = set()  # the page is closed
            else:
                self.send_header("Content-Type", "text/html; charset=utf-8")
                self.end_headers()
                self.wfile.write(PAGE.encode())

        def do_POST(self):
            keys = json.loads(self.rfile.read(int(self.headers["Content-Length"])))
            car.driver.keys = set(keys)
            self.send_response(204)
            self.end_headers()

        def log_message(self, *_):
            pass

    return Pages


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("--program", default="halfarrow", help="the program halfarrow")
    words.add_argument("--rate", default="1kHz", help="ticks a second")
    words.add_argument("--page", type=int, default=8000, help="port of the page")
    words.add_argument("--udp", type=int, default=5000, help="port of the inputs; that of the outputs is the next one")
    given, more = words.parse_known_args()
    if not any(word.startswith("u0=") for word in more):
        more += ["--set", "u0=0"]
    car = Car(given.udp, given.udp + 1)
    server = ThreadingHTTPServer(("127.0.0.1", given.page), pages(car))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    print(f"http://127.0.0.1:{given.page}, as soon as the model is compiled", flush=True)
    udp = [f"udp://127.0.0.1:{port}" for port in (given.udp, given.udp + 1)]
    command = [given.program, "run", HERE / "sedan.bond", "--rate", given.rate, "--input", udp[0], "--output", udp[1]]
    run = subprocess.Popen([*map(str, command), "--record", ",".join(VALUES), *more])
    try:
        raise SystemExit(run.wait())
    except KeyboardInterrupt:
        # It got the signal as well, and says how it went.
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        raise SystemExit(run.wait())


if __name__ == "__main__":
    main()
