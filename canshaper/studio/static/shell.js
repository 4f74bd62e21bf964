// What a live page and one of a drive that is over have in common: picture, charts, and their buttons.
import { Charts } from "/static/charts.js";
import { nameOf, text, translate } from "/static/language.js";
import { Plan } from "/static/plan.js";
import { Residual } from "/static/residual.js";
import { Scene } from "/static/scene.js";
import { SideView } from "/static/side_view.js";
import { chosenTheme } from "/static/theme.js";

const byId = (id) => document.getElementById(id);

export class Shell {
  constructor() {
    translate(byId("language"));
    this.other = null; // what is shown instead of the cranes
    byId("pause").onclick = () => this.pause(this.charts.stoppedAt === null);
    byId("longer").onclick = () => this.charts.zoom(1);
    byId("shorter").onclick = () => this.charts.zoom(-1);
    byId("csv").onclick = () => save(new Blob([this.charts.csv()], { type: "text/csv" }), "canshaper.csv");
    byId("png").onclick = () => this.charts.picture().toBlob((blob) => save(blob, "canshaper.png"));
    byId("view").onclick = () => this.overlay(!this.scene?.overlay);
    byId("above").onclick = () => this.look("plan");
    byId("left").onclick = () => this.look("residual");
    this.residual = new Residual(byId("residual"), byId("residual-words"));
    byId("theme").onclick = () => this.theme(document.documentElement.dataset.theme === "light" ? "dark" : "light");
    this.theme(chosenTheme());
    addEventListener("resize", () => {
      this.charts?.resize();
      this.residual.resize();
    });
  }

  /** Show other cranes. @param hello what there is. */
  begin(hello) {
    this.hello = hello;
    byId("view").hidden = hello.cranes.length < 2;
    byId("nopose").hidden = true;
    this.charts?.destroy();
    this.charts = new Charts(hello);
    this.plan = new Plan(byId("plan"), hello);
    this.scene?.dispose();
    try {
      this.scene = new Scene(byId("scene"), hello);
      // Else the last picture would stand there as if it were new.
      byId("scene").addEventListener("webglcontextlost", () => this.flat(text("page.lostwebgl")), { once: true });
    } catch (error) {
      this.flat(error.message);
    }
    byId("tabs").replaceChildren(...hello.axes.map((axis) => {
      const tab = document.createElement("button");
      tab.textContent = nameOf("axis", axis);
      tab.setAttribute("role", "tab");
      tab.dataset.axis = axis;
      tab.onclick = () => this.choose(axis);
      return tab;
    }));
    this.choose(hello.axes[0]);
    this.overlay(false);
    this.look(null);
  }

  /** The view from the side, and why. */
  flat(why) {
    const canvas = byId("scene").cloneNode(); // this one may have a context of the other kind
    byId("scene").replaceWith(canvas);
    canvas.setAttribute("aria-label", text("scene.side"));
    this.scene = new SideView(canvas, this.hello);
    byId("flat").textContent = text("page.flat", { why });
  }

  choose(axis) {
    this.charts.show(axis);
    this.residual.show(axis);
    for (const tab of byId("tabs").children) tab.setAttribute("aria-selected", tab.dataset.axis === axis);
  }

  /** Show where the cranes are. */
  show(message) {
    this.scene?.add(message);
    this.plan.add(message);
    const known = Object.values(message.cranes).some((crane) => crane.pose || crane.trolley);
    byId("nopose").hidden = known;
    byId("scene").hidden = !known || this.other !== null;
  }

  draw(now) {
    if (this.other === "plan") this.plan.draw(now);
    else if (this.other === null) this.scene?.draw(now);
    byId("coarse").hidden = !this.scene?.coarse;
    this.charts.draw(now);
  }

  pause(on) {
    this.charts.pause(on);
    byId("pause").setAttribute("aria-pressed", on);
  }

  overlay(on) {
    this.scene?.setOverlay(on);
    byId("view").setAttribute("aria-pressed", on);
  }

  /** Show the plan or the residual instead of the cranes, or the cranes again. */
  look(other) {
    this.other = this.other === other ? null : other;
    for (const [button, id] of [["above", "plan"], ["left", "residual"]]) {
      byId(id).hidden = this.other !== id;
      byId(button).setAttribute("aria-pressed", this.other === id);
    }
    this.residual.build();
  }

  theme(name) {
    document.documentElement.dataset.theme = name;
    localStorage.setItem("theme", name);
    this.scene?.paint();
    this.plan?.paint();
    this.residual.build();
    this.charts?.build();
  }
}

function save(blob, name) {
  const link = Object.assign(document.createElement("a"), { href: URL.createObjectURL(blob), download: name });
  link.click();
  URL.revokeObjectURL(link.href);
}
