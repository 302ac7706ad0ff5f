"use strict";
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);

function make(tag, content = [], attributes = {}) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.append(...[content].flat());
  return node;
}

function fill(id, ...content) { $(id).replaceChildren(...content); }

function table(id, title, rows) {
  fill(id, ...(rows.length ? [make("caption", title)] : []),
    ...rows.map(([name, value]) => make("tr", [make("th", name, {scope: "row"}), make("td", String(value))])));
}

const words = (name) => name.replaceAll("_", " ");

// The policy graph lives in a shadow tree, so that its style stays inside.

const graph = $("graph").attachShadow({mode: "open"});
graph.innerHTML = data.graph;  // made by gentamp_lp.drawing, which escapes every name
graph.append(make("style", `
  svg{max-width:100%;height:auto;min-width:min(100%,20rem)} svg>rect,.l{fill:var(--paper)} text{fill:var(--ink)}
  .h{fill:var(--soft)} .a{fill:var(--blue)} .n{fill:var(--card);stroke:var(--soft)} .i{fill:var(--pale);stroke:var(--blue)}
  .g{fill:var(--mint);stroke:var(--green)} .o{stroke:var(--green)} .w{stroke:var(--soft)} marker path{fill:var(--soft)}
  .s{cursor:pointer} .s:focus{outline:none} .s:focus-visible>rect:first-of-type,.s:hover>rect:first-of-type{stroke:var(--blue);stroke-width:2.5}
  .s.chosen>rect:first-of-type{stroke:var(--blue);stroke-width:4}`));
const nodes = [...graph.querySelectorAll(".s")];

function choose(name) {
  for (const node of nodes) {
    const chosen = node.dataset.state === name;
    node.classList.toggle("chosen", chosen);
    node.setAttribute("aria-pressed", chosen);
  }
  const state = data.states.find((other) => other.state === name);
  const title = nodes.find((node) => node.dataset.state === name)?.querySelector(".h")?.textContent;
  if (!state) {
    fill("state", make("h3", name), make("p", "The policy has no rule for this abstract state."));
    return;
  }
  const marks = [state.initial && make("span", "initial", {class: "chip initial"}), state.goal && make("span", "goal", {class: "chip goal"})];
  const rows = state.values.map((value, i) =>
    make("tr", [make("th", value, {scope: "row"}), make("td", data.features[i].formula, {class: "formula"})]));
  const jump = (other) => {
    const button = make("button", other, {class: "chip"});
    button.addEventListener("click", () => choose(other));
    return button;
  };
  const ends = data.ends.flatMap((end, i) => (end.states.includes(name) ? [`${i + 1}. ${end.feature}`] : []));
  fill("state", make("h3", (title || name).split(" ")[0]), ...marks.filter(Boolean), make("table", rows, {class: "values"}),
    make("p", state.goal ? "Nothing is left to do here." : state.does ? `The policy does ${state.does}.` : "The policy has no rule here.", {class: "next"}),
    ...(state.outcomes.length ? [make("p", "It may lead to"), make("p", state.outcomes.map(jump))] : []),
    ...(ends.length ? [make("p", `Why this does not go on for ever: see ${ends.join(", ")} under “Why it ends”.`, {class: "quiet"})] : []));
}

for (const node of nodes) {
  node.setAttribute("tabindex", "0");
  node.setAttribute("role", "button");
  node.setAttribute("aria-label", node.dataset.state);
  node.addEventListener("click", () => choose(node.dataset.state));
  node.addEventListener("keydown", (event) => {
    if (event.key !== "Enter" && event.key !== " ") return;
    event.preventDefault();
    choose(node.dataset.state);
  });
}

// Runs: a plan or a demonstration, one state at a time; an animated run also has a place between its states.

let run, index = 0, player = null, playing = 0;

function show(number) {
  index = Math.max(0, Math.min(number, run.states.length - 1));
  const state = run.states[index], before = run.states[index - 1];
  const rows = data.features.map((feature) => {
    const value = state.values[feature.name];
    const old = before && before.values[feature.name];
    const held = state.holds[feature.name];
    return make("tr", [make("th", feature.name, {scope: "row", title: feature.formula}),
      make("td", [make("strong", String(value)), ...(before && old !== value ? [make("span", ` was ${old}`, {class: "quiet"})] : [])]),
      make("td", make("div", held && held.length ? held.join(", ") : value && !held ? "holds" : "–", {class: "names"}), {class: "quiet"})]);
  });
  fill("moment", make("h3", `State ${index} of ${run.states.length - 1}`),
    make("p", state.step ? `Next: ${state.step}` : "The end.", {class: "next"}),
    make("table", rows, {class: "values"}), make("p", `The policy does ${state.does}.`, {class: "quiet"}));
  $("position").value = index;
  for (const [i, item] of [...$("steps").children].entries()) item.firstChild.toggleAttribute("aria-current", i === index);
  choose(state.abstract);
}

function start(number) {
  stop();
  run = data.runs[number];
  $("position").max = run.states.length - 1;
  fill("steps", ...run.states.map((state, i) => {
    const button = make("button", state.step || "end");
    button.addEventListener("click", () => go(i));
    return make("li", button);
  }));
  $("steps").start = 0;
  $("stage").hidden = !run.animation;
  player = run.animation ? (run.player ??= new Player(run.animation)) : null;
  go(0);
}

function go(number) {
  stop();
  show(number);
  player?.at(player.end(index));
}

function stop() {
  cancelAnimationFrame(playing);
  clearTimeout(playing);
  playing = 0;
  $("play").textContent = "Play";
}

function play() {
  if (playing) { stop(); return; }
  if (index === run.states.length - 1) go(0);
  $("play").textContent = "Pause";
  if (!player) {
    const tick = () => { show(index + 1); if (index < run.states.length - 1) playing = setTimeout(tick, 900); else stop(); };
    playing = setTimeout(tick, 300);
    return;
  }
  let last = performance.now();
  const tick = (now) => {
    player.at(player.place + Math.max(0, now - last) / 60);  // the first frame may have begun before the click
    last = now;
    const reached = player.reached();
    if (reached !== index) show(reached);
    if (player.place < player.frames.length - 1) playing = requestAnimationFrame(tick); else stop();
  };
  playing = requestAnimationFrame(tick);
}

// The viewer is trimesh's (three.js inside); the page only moves its nodes.

class Player {
  constructor({viewer, frames, camera}) {
    const places = {};
    const canvas = document.createElement("canvas");
    this.frames = frames.map(([step, moved]) => ({step, places: {...Object.assign(places, moved)}}));
    this.camera = camera;
    this.place = 0;
    if (!canvas.getContext("webgl2") && !canvas.getContext("webgl")) {
      fill("view", make("p", "This browser cannot draw in three dimensions; the steps can be followed all the same."));
      return;
    }
    const frame = make("iframe", [], {title: "The plan in three dimensions"});
    frame.srcdoc = viewer;
    fill("view", frame);
    this.window = frame.contentWindow;
    this.frame = frame;
    const wait = () => (frame.contentWindow.controls ? this.ready() : setTimeout(wait, 50));
    wait();
  }

  ready() {
    const {scene, camera, controls, THREE, tracklight, onWindowResize} = (this.window = this.frame.contentWindow);
    tracklight.intensity = 0.6;
    scene.add(new THREE.HemisphereLight(0xffffff, 0x8899aa, 0.65));
    scene.traverse(({material}) => material && Object.assign(material, {metalness: 0, roughness: 0.9}));
    scene.background = new THREE.Color(matchMedia("(prefers-color-scheme:dark)").matches ? 0x26313c : 0xeef2f6);
    camera.up.set(0, 0, 1);
    camera.near = 0.02;
    camera.position.set(...this.camera.eye);
    controls.target.set(...this.camera.target);
    controls.update();
    controls.position0.copy(camera.position);
    controls.target0.copy(controls.target);
    controls.up0.copy(camera.up);
    this.window.addEventListener("keydown", (event) => this.turn(event));
    const fit = () => {  // a narrow window shows as much from left to right as one of 4 by 3
      const narrow = Math.max(1, 4 / 3 / (this.window.innerWidth / this.window.innerHeight));
      camera.fov = (Math.atan(Math.tan((this.camera.angle * Math.PI) / 360) * narrow) * 360) / Math.PI;
      onWindowResize();
    };
    this.window.addEventListener("resize", fit);
    fit();
    this.nodes = Object.keys(this.frames[0].places).map((n) => scene.getObjectByName(`n${n}`));
    this.at(this.place);
    this.frame.dataset.ready = "yes";
  }

  home() { this.window?.controls.reset(); }

  turn(event) {
    const {camera, controls, THREE} = this.window;
    const offset = camera.position.clone().sub(controls.target);
    const side = new THREE.Vector3().crossVectors(camera.up, offset).normalize();
    const turns = {ArrowLeft: [camera.up, -0.1], ArrowRight: [camera.up, 0.1], ArrowUp: [side, -0.1], ArrowDown: [side, 0.1]};
    const zooms = {"+": 0.9, "-": 1.1};
    if (event.key in turns) offset.applyAxisAngle(...turns[event.key]);
    else if (event.key in zooms) offset.multiplyScalar(zooms[event.key]);
    else return;
    event.preventDefault();
    camera.position.copy(controls.target).add(offset);
  }

  end(step) { return this.frames.findLastIndex((frame) => frame.step <= step); }

  reached() {
    const {step} = this.frames[Math.floor(this.place)];
    return this.place >= this.end(step) ? step : Math.max(0, step - 1);
  }

  at(place) {
    this.place = Math.min(place, this.frames.length - 1);
    if (!this.nodes) return;
    const low = Math.floor(this.place), share = this.place - low, {Quaternion, Vector3} = this.window.THREE;
    const here = this.frames[low].places, there = this.frames[Math.min(low + 1, this.frames.length - 1)].places;
    this.nodes.forEach((node, n) => {
      node.position.set(...here[n].slice(0, 3)).lerp(new Vector3(...there[n].slice(0, 3)), share);
      node.quaternion.set(...here[n].slice(3)).slerp(new Quaternion(...there[n].slice(3)), share);
    });
    this.window.render();
  }
}

// The page

document.title = `${data.task} – gentamp-lp report`;
fill("task", data.task);
fill("description", data.description);
fill("goal", data.goal);
fill("proof", `${data.features.length} features, ${data.proof}; fairness: ${data.fairness}`);
fill("features", ...data.features.map((f) => make("article", [
  make("h3", [`${f.name} `, make("span", f.kind, {class: "chip"}), make("span", `cost ${f.cost}`, {class: "chip"}),
    ...(f.open === null ? [] : [make("span", f.open ? "open: depends on sampling" : "closed", {class: "chip"})])]),
  make("p", f.formula, {class: "formula"}),
  make("ul", f.used.map((use) => make("li", use))),
  ...(f.why ? [make("details", [make("summary", "Why it was chosen"), make("p", f.why)])] : [])], {class: "card"})));
fill("ends", ...data.ends.map((end) => make("li",
  `${end.feature} falls and never rises among ${end.states.length} abstract state${end.states.length > 1 ? "s" : ""}: ${end.states.join("; ")}.`)));
table("numbers", "What was learned from", Object.entries(data.numbers).map(([name, value]) => [words(name), value]));
table("seconds", "Seconds", Object.entries(data.seconds).map(([name, value]) => [words(name), value.toFixed(2)]));
$("pruned").hidden = !data.pruning.length;
const columns = [...new Set(data.pruning.flatMap(Object.keys))];
fill("pruning", make("thead", make("tr", columns.map((name) => make("th", words(name), {scope: "col"})))),
  ...data.pruning.map((row) => make("tr", columns.map((name) => make("td", String(row[name] ?? ""))))));
fill("notes", ...data.notes.map((note) => make("li", note)));
fill("run", ...data.runs.map((other, i) => make("option", other.title, {value: i})));
$("run").addEventListener("change", (event) => start(Number(event.target.value)));
$("first").addEventListener("click", () => go(0));
$("back").addEventListener("click", () => go(index - 1));
$("next").addEventListener("click", () => go(index + 1));
$("play").addEventListener("click", play);
$("home").addEventListener("click", () => player.home());
$("position").addEventListener("input", (event) => go(Number(event.target.value)));
document.addEventListener("keydown", (event) => {
  if (event.defaultPrevented || event.target.closest?.("input,select,summary,button") || event.altKey || event.ctrlKey || event.metaKey) return;
  const keys = {ArrowLeft: () => go(index - 1), ArrowRight: () => go(index + 1), Home: () => go(0), " ": play};
  if (!keys[event.key]) return;
  event.preventDefault();
  keys[event.key]();
});
start(0);
