"use strict";
// Curves of one boundary share what part of it they show, and the node that is pointed at.
function number(value) {
  return value === null || isNaN(value) ? "" : String(parseFloat(value.toPrecision(5))).replace("-", "\u2212");
}
function element(kind, parent, text, name) {
  var made = document.createElement(kind);
  if (text) made.textContent = text;
  if (name) made.className = name;
  parent.appendChild(made);
  return made;
}
function plot(place) {
  var data = JSON.parse(place.querySelector("script").textContent);
  var graphs = [];
  var buttons = element("p", place, "", "buttons");
  function show(part) {
    graphs.forEach(function (graph, k) {
      graph.updateOptions({ dateWindow: part, valueRange: part ? [null, null] : data.panels[k].range });
    });
  }
  if (data.window) {
    element("button", buttons, "contact zone").onclick = function () { show(data.window); };
  }
  element("button", buttons, "whole boundary").onclick = function () { show(null); };
  var grid = element("div", place, "", "grid");
  var key = element("p", place, "", "note key");
  element("span", key, "below the curves, along " + data.x + ": ");
  data.key.forEach(function (state) {
    var entry = element("span", key);
    element("i", entry).style.background = state[0];
    entry.appendChild(document.createTextNode(state[1]));
  });
  // All cells first: a plot takes the width that its cell has when it is made.
  var cells = data.panels.map(function () { return element("div", grid); });
  data.panels.forEach(function (panel, place) {
    var cell = cells[place];
    var legend = element("div", cell, "", "values");
    var canvas = element("div", cell, "", "plot");
    var series = {};
    panel.names.forEach(function (name, k) {
      series[name] = { color: panel.colours[k], strokePattern: panel.dashes[k], strokeWidth: k ? 1.3 : 1.7 };
    });
    // Without the gestures of dygraphs a finger scrolls the page.
    var gestures = Object.assign({}, Dygraph.defaultInteractionModel);
    ["touchstart", "touchmove", "touchend"].forEach(function (name) { delete gestures[name]; });
    var graph = new Dygraph(canvas, panel.rows, {
      labels: [data.x].concat(panel.names),
      series: series,
      legend: "always",
      labelsDiv: legend,
      legendFormatter: function (found) {
        var at = found.x === undefined ? "" : data.x + " = " + number(found.x) + ", ";
        var seen = {};
        return "<small>" + panel.unit + "</small> " + at + found.series.map(function (one) {
          var name = one.label.split(",")[0];
          if (seen[name]) return "";
          seen[name] = true;
          var dash = panel.dashes[panel.names.indexOf(one.label)] ? "dashed" : "solid";
          var key = '<i style="border-color:' + one.color + ";border-style:" + dash + '"></i>';
          return "<span>" + key + name + " <b>" + number(one.y === undefined ? NaN : one.y) + "</b></span>";
        }).join(" ");
      },
      axes: {
        x: { axisLabelFormatter: number, valueFormatter: number, drawGrid: false },
        y: { axisLabelFormatter: number, valueFormatter: number, axisLabelWidth: 72, pixelsPerLabel: 28 }
      },
      axisLabelFontSize: 12,
      axisLineColor: "#6b6b6b",
      gridLineColor: "#e4e4e4",
      xRangePad: 3,
      highlightCircleSize: 3,
      valueRange: panel.range,
      interactionModel: gestures,
      underlayCallback: function (context, area, self) {
        data.states.forEach(function (run) {
          var left = Math.max(self.toDomXCoord(run[0]), area.x);
          var right = Math.min(self.toDomXCoord(run[1]), area.x + area.w);
          context.fillStyle = run[2];
          if (right > left) context.fillRect(left, area.y + area.h - 6, right - left, 6);
        });
      },
      highlightCallback: function (event, x, points, row) {
        graphs.forEach(function (other) { if (other !== graph) other.setSelection(row); });
      },
      unhighlightCallback: function () {
        graphs.forEach(function (other) { if (other !== graph) other.clearSelection(); });
      },
      zoomCallback: function (low, high) {
        show(graph.isZoomed() ? [low, high] : null);
      }
    });
    graphs.push(graph);
  });
  if (data.window) show(data.window);
}
if (typeof Dygraph !== "undefined") {
  document.querySelectorAll(".plots, .hint").forEach(function (place) { place.hidden = false; });
  document.querySelectorAll(".plots").forEach(plot);
  document.querySelectorAll("figure.curves").forEach(function (still) { still.classList.add("replaced"); });
}
